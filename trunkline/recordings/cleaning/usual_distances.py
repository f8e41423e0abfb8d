"""Distances between the bodies of a session, by which label swaps and misplaced markers show."""

import numpy as np

SAMPLE = 200  # frames of a log from which the usual distances come


def usual_distances(logs: list[np.ndarray]) -> np.ndarray:
    """Median distances (B, B) in m between the bodies of logs (T, B, 3); NaN where two are never seen together."""
    samples = []
    for positions in logs:
        some = positions[:: max(1, len(positions) // SAMPLE)]
        some = np.where(np.isfinite(some), some, np.nan)
        samples.append(np.linalg.norm(some[:, :, None] - some[:, None], axis=-1))
    together = np.concatenate(samples)
    distances = np.full(together.shape[1:], np.nan)
    for first, second in zip(*np.triu_indices(len(distances), 1), strict=True):
        apart = together[:, first, second]
        apart = apart[np.isfinite(apart)]
        if len(apart):
            distances[first, second] = distances[second, first] = np.median(apart)
    return distances
