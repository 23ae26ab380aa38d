"""The plate's law as what an engine takes: one acceleration per axis and step.

Both forms make a plate of enormous inertia, driven by nothing but these
accelerations, follow the law without drift.
"""

import numpy as np

from equations import compiled

PULL = 0.5  # share of an angle's error that the next step takes back


def semi_implicit(scene, step, count):
    """For v += h·a; q += h·v: the angles are exact after each step."""
    angles, rates = _sampled(scene, step, count)
    chords = np.vstack([rates[:1], np.diff(angles, axis=0) / step])
    return np.diff(chords, axis=0) / step


def second_order(scene, step, count):
    """For methods exact under constant acceleration: rates and angles to O(h³)."""
    return _steer(*_sampled(scene, step, count), step)


def _sampled(scene, step, count):
    law = scene.law(step * np.arange(count + 1))
    return law[:, :2].copy(), law[:, 2:4].copy()


@compiled
def _steer(angles, rates, step):
    accelerations = np.empty((len(angles) - 1, 2))
    for axis in range(2):
        q, v = angles[0, axis], rates[0, axis]
        for n in range(len(angles) - 1):
            goal = rates[n + 1, axis] + PULL * (angles[n, axis] - q) / step
            accelerations[n, axis] = (goal - v) / step
            q += 0.5 * step * (v + goal)
            v = goal
    return accelerations
