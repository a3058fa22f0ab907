"""Sections 2 and 7.11: refusing, and the classes of refusal."""


class Refused(Exception):
    """No frame is made from what was read. `kind` is a class of section 7.11."""

    def __init__(self, kind, why):
        super().__init__(f"{kind}: {why}")
        self.kind = kind


def malformed_if(condition, why):
    if condition:
        raise Refused("malformed", why)
