"""CPU time of this thread, and the records that come of it."""

import argparse
import json
import statistics
import sys
import time

import numpy as np

import reference
from scenes import chosen

REPEATS = 3
SHORTEST = 20_000_000  # ns that the repeats of a short run should add up to
LONGEST = 20_000_000_000  # ns after which repeating stops early
MOST = 1000


def cpu_times(run, prepare=None):
    """CPU nanoseconds of this thread for each repeat of `run`, without `prepare`."""
    times = []
    while len(times) < REPEATS or (sum(times) < SHORTEST and len(times) < MOST):
        prepared = prepare() if prepare else ()
        begin = time.thread_time_ns()
        run(*prepared)
        times.append(time.thread_time_ns() - begin)
        if sum(times) > LONGEST:
            break
    return times


def worst_error(positions, truth):
    """Largest distance in x, y over the samples; None where it is not a number."""
    gaps = np.linalg.norm(np.asarray(positions)[:, :2] - truth[:, :2], axis=1)
    worst = float(gaps.max())
    return worst if np.isfinite(worst) else None


class Bench:
    """Collects the records of one engine."""

    def __init__(self, engine):
        self.engine = engine
        self.records = []

    def add(self, scene, labels, trace, run, prepare=None):
        """Measure one setting.

        `labels` is (model, method, setting, value), `trace` gives the positions
        at the scene's samples in the plate's frame, and `run` does the same work
        without keeping them; only `run` is timed, with what `prepare` made for it.
        """
        record = dict(zip(("model", "method", "setting", "value"), labels, strict=True))
        record |= {"scene": scene.name, "engine": self.engine}
        record |= {"error_m": None, "cpu_us_per_s": None, "spread": None, "note": None}
        try:
            record["error_m"] = worst_error(trace(), reference.load(scene))
            record |= self._cost(scene, run, prepare)
        except Exception as failure:  # noqa: BLE001 (whatever a peer throws is its result)
            record["error_m"] = None
            record["note"] = f"did not finish: {failure}".splitlines()[0][:120]
        else:
            record["note"] = None if record["error_m"] is not None else "non-finite"
        self.records.append(record)
        print(summary(record), file=sys.stderr, flush=True)

    @staticmethod
    def _cost(scene, run, prepare):
        times = cpu_times(run, prepare)
        best = min(times)
        return {
            "cpu_us_per_s": best / 1000 / scene.duration,
            "spread": statistics.median(times) / best,
        }


def summary(record):
    """One line on a record, for whoever watches."""
    error, cost = record["error_m"], record["cpu_us_per_s"]
    return " ".join([
        f"{record['scene']:10} {record['engine']:14} {record['method']:24} {record['value']:<8g}",
        "error    –   " if error is None else f"error {error:.1e}",
        "" if cost is None else f"{cost:10.1f} µs/s",
        record["note"] or "",
    ])


def main(engine, versions, measure):
    """Command line of an engine's module: `measure(bench, scene, quick)` per scene."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--quick", action="store_true", help="fewer scenes and settings")
    arguments = parser.parse_args()
    bench = Bench(engine)
    for scene in chosen(arguments.quick):
        measure(bench, scene, arguments.quick)
    json.dump({"versions": versions, "records": bench.records}, sys.stdout)
