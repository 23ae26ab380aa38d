"""How a verdict is shown and kept."""

from __future__ import annotations

import builtins
import multiprocessing
import pickle
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib
import pandas as pd
import pytest
from matplotlib import pyplot

import offbd

matplotlib.use("agg")


@pytest.fixture(scope="module")
def verdict(folder: Path) -> offbd.Verdict:
    return offbd.replay(folder / "sick.csv", folder / "calibrated.json", evidence=True)


def test_a_notebook_shows_a_verdict_as_a_table(verdict: offbd.Verdict) -> None:
    table = ET.fromstring(verdict._repr_html_())
    assert table.tag == "table"
    (caption,) = table.iter("caption")
    assert caption.text is not None and caption.text.startswith("sick.csv: x_servo (")
    head, *rows = table.iter("tr")
    assert len(rows) == len(verdict.faults)
    names = [cell.text for cell in head]
    for row, fault in zip(rows, verdict.faults, strict=True):
        cells = dict(zip(names, (cell.text or "" for cell in row), strict=True))
        assert cells["time, s"] == f"{fault['t_s']:.2f}"
        assert (cells["fault"], cells["status"]) == (fault["code"], fault["status"])
        assert cells["kind"] == (fault.get("kind") or "")
        for cause in fault["candidates"]:
            assert f"{cause.get('kind')} {cause['weight']:.0%}" in cells["causes"]
        assert row.get("title") == fault["summary"]


def test_what_a_notebook_shows_is_escaped_and_short(folder: Path) -> None:
    name = "<script>alert('&')</script>"
    healthy = offbd.replay(folder / "healthy.csv", folder / "calibrated.json", session=name)
    shown = ET.fromstring(healthy._repr_html_())
    assert shown.text is not None and f"{name}: no confirmed fault" in shown.text
    sick = offbd.replay(folder / "sick.csv", folder / "calibrated.json", session=name)
    odd = {**sick.faults[0], "summary": '"<b>', "kind": "<i>"}
    many = replace(sick, faults=[odd] * 30)  # type: ignore[list-item]
    rows = list(ET.fromstring(many._repr_html_()).iter("tr"))
    assert [cell.text for cell in rows[-1]] == ["10 more changes"] and len(rows) == 22
    assert rows[1].get("title") == '"<b>'


def test_a_plot_shows_both_positions_and_the_faults(verdict: offbd.Verdict) -> None:
    assert verdict.evidence is not None
    axes = verdict.plot()
    confirmed = next(f for f in verdict.faults if f["status"] == "confirmed")
    evidence = pd.DataFrame.from_arrow(verdict.evidence).set_index("t_s")
    for axis, name in zip(axes, ("x", "y"), strict=True):
        lines: dict[Any, Any] = {line.get_label(): line for line in axis.lines}
        for label, column in (("measured", "position_m"), ("twin", "twin_position_m")):
            drawn = pd.Series(*reversed(lines.pop(label).get_data()))
            assert drawn.index.is_unique and len(drawn.dropna()) > 500
            wanted = evidence[f"{name}_{column}"][~evidence.index.duplicated()]
            assert drawn.dropna().equals(wanted.dropna())
        if name == "x":
            (label,) = lines
            assert (
                label == "x_servo dead\nconfirmed"
                and lines[label].get_xdata()[0] == confirmed["t_s"]
            )
            assert len(axis.patches) == 1
        else:
            assert not lines and not axis.patches
    own = pyplot.subplots(2)[1]
    assert verdict.plot(own) is own and len(own[0].lines) == 3
    pyplot.close("all")


def test_the_twin_follows_a_healthy_rig_and_leaves_a_sick_one(verdict: offbd.Verdict) -> None:
    assert verdict.evidence is not None
    frame = pd.DataFrame.from_arrow(verdict.evidence).set_index("t_s")
    error_m = (frame["x_twin_position_m"] - frame["x_position_m"]).abs()
    assert error_m.loc[2.0:19.5].quantile(0.9) < 0.01 < error_m.loc[20.0:22.0].max()


def test_what_a_plot_lacks_is_named(
    verdict: offbd.Verdict, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(ValueError, match="evidence=True"):
        replace(verdict, evidence=None).plot()
    load = builtins.__import__

    def without_matplotlib(name: str, *more: Any, **named: Any) -> Any:
        if name.partition(".")[0] == "matplotlib":
            raise ImportError(name)
        return load(name, *more, **named)

    monkeypatch.setattr(builtins, "__import__", without_matplotlib)
    with pytest.raises(ImportError, match=r"pip install offbd\[plot\]"):
        verdict.plot()


def test_a_pickled_verdict_is_the_same(verdict: offbd.Verdict) -> None:
    again: offbd.Verdict = pickle.loads(pickle.dumps(verdict))
    assert verdict.evidence is not None and again.evidence is not None
    assert again.evidence.to_pydict() == verdict.evidence.to_pydict()
    assert replace(again, evidence=None) == replace(verdict, evidence=None)
    empty = offbd.simulate(seconds=1, seq=True).table
    assert pickle.loads(pickle.dumps(empty)).to_pydict() == empty.to_pydict()


@pytest.mark.parametrize("share", [0.0, 0.3, 0.335, 0.9, 1.0])
def test_a_pickled_engine_goes_on_to_the_bit(folder: Path, share: float) -> None:
    frame = pd.read_csv(folder / "sick.csv")
    frame.loc[5, "x_m"] = 1e9
    cut = int(share * len(frame))
    engine = offbd.Engine(folder / "calibrated.json", session="s")
    engine.add(frame[:cut])
    copy: offbd.Engine = pickle.loads(pickle.dumps(engine))
    assert copy.summary() == engine.summary()
    assert copy.add(frame[cut:]) == engine.add(frame[cut:])
    one, other = engine.end(), copy.end()
    assert one == other and one.confirmed == ["x_servo"]
    assert one.summary["rejected"] == 1
    with pytest.raises(RuntimeError, match="has ended"):
        pickle.loads(pickle.dumps(copy)).end()


def test_an_engine_of_another_version_is_refused() -> None:
    version, state = offbd.Engine().__getstate__()
    other = offbd.Engine.__new__(offbd.Engine)
    with pytest.raises(ValueError, match=f"by version 0.0, offbd 0; this is {version}"):
        other.__setstate__(("0.0, offbd 0", state))
    with pytest.raises(ValueError):
        other.__setstate__((version, state[:-9]))


def evidence_of(path: str) -> offbd.Verdict:
    return offbd.replay(path, evidence=True)


def test_verdicts_come_from_other_processes(folder: Path) -> None:
    paths = [str(folder / name) for name in ("healthy.csv", "sick.csv")]
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        verdicts = pool.map(evidence_of, paths)
    assert [verdict.hash for verdict in verdicts] == [offbd.replay(path).hash for path in paths]
