"""Section 7.10.6: temporal prediction."""

from conventions import add
from warp import warp


def split_vector(vector):
    """(whole, t)"""
    whole = tuple((c + 16) // 32 for c in vector)
    return whole, tuple(c - 32 * n for c, n in zip(vector, whole))


def predict_temporal(reference, b, vector, mu_codes):
    whole, t = split_vector(vector)
    return warp(reference.samples, add(b, whole), t, (0, 0, 0), 8, mu_codes)
