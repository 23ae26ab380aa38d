"""One file of records out of those of all engines, with the machine they ran on."""

import argparse
import importlib.metadata
import json
import os
import pathlib
import platform
import subprocess

FEATURES = ("sse4_2", "avx", "avx2", "fma", "avx512f", "neon", "asimd", "sve")


def cpu_info(key):
    """The first value of a key in Linux's list of processors; empty elsewhere."""
    try:
        lines = pathlib.Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return ""
    values = (line.partition(":")[2].strip() for line in lines if line.split(":")[0].strip() == key)
    return next(values, "")


def machine():
    """What the figures hold for."""
    flags = f"{cpu_info('flags')} {cpu_info('Features')}".split()
    return {
        "cpu": cpu_info("model name") or platform.processor() or platform.machine(),
        "cores": os.cpu_count(),
        "features": [feature for feature in FEATURES if feature in flags],
        "os": f"{platform.system().lower()} {platform.machine()}",
    }


def tools():
    """Versions of what the equations and the crates were compiled with."""
    found = {"python": platform.python_version()}
    for package in ("numpy", "numba"):
        found[package] = importlib.metadata.version(package)
    try:
        rustc = subprocess.run(["rustc", "--version"], capture_output=True, text=True, check=True)
        found["rustc"] = rustc.stdout.split()[1]
    except (OSError, subprocess.CalledProcessError):
        pass
    return found


def load(path):
    """Each engine's name with the load average when it began."""
    return [line.split() for line in path.read_text().splitlines()]


def main():
    """Merge the files that are given."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", required=True)
    parser.add_argument("--load", required=True, type=pathlib.Path)
    parser.add_argument("parts", nargs="+", type=pathlib.Path)
    arguments = parser.parse_args()
    merged = {"chart": "work-precision", "machine": machine(), "versions": tools()}
    merged |= {"load": load(arguments.load), "records": []}
    for part in arguments.parts:
        content = json.loads(part.read_text())
        merged["versions"] |= content["versions"]
        merged["records"] += content["records"]
    pathlib.Path(arguments.output).write_text(json.dumps(merged, indent=1) + "\n")


if __name__ == "__main__":
    main()
