"""The cheapest setting of each peer for a given error, as a table in Markdown.

python3 benches/peers/best.py [FILE], with the records that `run` wrote.
"""

import json
import pathlib
import sys

SCENES = ("sine", "steep")
LIMITS = (1e-3, 1e-4, 1e-5)
STAGGERED = ", staggered start"


def row_of(record):
    """The row that a record competes in."""
    engine, method = record["engine"], record["method"]
    if record["setting"] == "tolerance":
        return f"{engine} {method}, {record['model']}"
    tuned = "as shipped" if "as shipped" in method else "tuned"
    return f"{engine}, {tuned}" + (STAGGERED if method.endswith(STAGGERED) else "")


def cheapest(records, scene, limit):
    """The least µs per simulated second whose error is within the limit."""
    costs = [
        record["cpu_us_per_s"] for record in records
        if record["scene"] == scene and record["error_m"] is not None
        and record["error_m"] <= limit
    ]
    return min(costs, default=None)


def show(cost):
    """Three digits are more than the spread warrants."""
    if cost is None:
        return "–"
    return f"{cost:.1f}" if cost < 100 else f"{cost:,.0f}".replace(",", " ")


def main():
    """Print the table."""
    default = pathlib.Path(__file__).resolve().parent / "peers.json"
    path = pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else default
    rows = {}
    for record in json.loads(path.read_text())["records"]:
        rows.setdefault(row_of(record), []).append(record)
    cells = [(scene, limit) for scene in SCENES for limit in LIMITS]
    heads = [f"{scene} ≤ {limit:.0e}".replace("e-0", "e-") for scene, limit in cells]
    print("| peer |", " | ".join(heads), "|")
    print("| --- |", " | ".join(["--:"] * len(cells)), "|")
    for row in sorted(rows):
        print(f"| {row} |", " | ".join(show(cheapest(rows[row], *cell)) for cell in cells), "|")


if __name__ == "__main__":
    main()
