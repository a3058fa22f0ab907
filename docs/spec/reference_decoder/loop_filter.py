"""Section 7.10.7: in-loop filter."""

import numpy as np

from conventions import add


def is_filtered(volume, lower, upper):
    """Whether the face between two blocks coded in this frame is filtered."""
    vectors = volume.vectors.get(lower), volume.vectors.get(upper)
    return vectors[0] is None or vectors[0] != vectors[1] or volume.levels_of[lower] + volume.levels_of[upper] > 0


def filter_faces(frame, volume, mu_codes):
    """`volume` holds the blocks coded in this frame and no others."""
    if frame.filter == 0:
        return
    for axis, ahead in enumerate([(1, 0, 0), (0, 1, 0), (0, 0, 1)]):
        for lower in volume.samples:
            upper = add(lower, ahead)
            if upper in volume.samples and is_filtered(volume, lower, upper):
                smooth_face(volume.samples[lower], volume.samples[upper], axis, frame.filter, frame.filter_limit, mu_codes)


def smooth_face(lower, upper, axis, strength, limit, mu_codes):
    """smooth_line for the 64 lines of the face at once; changes the samples of both blocks."""
    lower, upper = np.moveaxis(lower, 2 - axis, 0), np.moveaxis(upper, 2 - axis, 0)
    p = [lower[7 - i].astype(np.int64) for i in range(3)]
    q = [upper[i].astype(np.int64) for i in range(3)]
    filtered = np.minimum(np.abs(p[0]), np.abs(q[0])) <= 640
    step = 3 * (q[0] - p[0]) + p[1] - q[1]
    m = [np.minimum(strength * np.abs(step) >> 7, limit)]
    m += [m[0] >> 1, 13 * m[0] >> 6]
    for i in range(3):
        m[i] = np.where(filtered, np.where(step < 0, -m[i], m[i]), 0)
        lower[7 - i] = np.clip(p[i] + m[i], -mu_codes, mu_codes)
        upper[i] = np.clip(q[i] - m[i], -mu_codes, mu_codes)
