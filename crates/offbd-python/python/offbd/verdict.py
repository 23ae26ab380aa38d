"""The result of judging a recording, and how it is shown."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Any

from ._offbd import Table

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes

    from . import documents as doc

MAX_SHOWN = 20
"""Most changes of faults in the table of a notebook."""


@dataclass(frozen=True)
class RejectedRow:
    """A row that is not a sample."""

    row: int
    """Number of the row, from 1; in a file of text that of the line."""
    reason: str


@dataclass(frozen=True)
class Verdict:
    """The result of judging a recording."""

    faults: list[doc.Fault]
    """The changes of faults, as the lines of `offbd replay --format json`."""
    summary: doc.Summary
    """The summary of the session, as the last line of `offbd replay --format json`."""
    rejected: list[RejectedRow]
    """The first rejected rows; `summary["rejected"]` is the number of all."""
    n_set_aside: int
    """Rows that are kept but not judged: too late, or too far ahead in time."""
    evidence: Table | None
    """The quantities of the diagnosis at each judged sample, if they were asked for."""

    @property
    def hash(self) -> str:
        """SHA-256 of the verdict; equal judgements have equal hashes."""
        return str(self.summary["verdict_hash"])

    @property
    def confirmed(self) -> list[doc.FaultCode]:
        """The codes of the confirmed faults."""
        return list(self.summary["faults"])

    def _repr_html_(self) -> str:
        """The verdict as a table, for notebooks."""
        summary = self.summary
        judged = f"{summary['samples']} samples in {summary['duration_s']:.1f} s"
        found = ", ".join(self.confirmed) or "no confirmed fault"
        caption = f"{escape(summary['session'])}: {escape(found)} ({judged})"
        if not self.faults:
            return f"<p>{caption}</p>"
        names = ("time, s", "fault", "kind", "status", "began, s", "causes")
        head = "".join(f"<th>{name}</th>" for name in names)
        rows = [_html_row(fault) for fault in self.faults[:MAX_SHOWN]]
        n_more = len(self.faults) - len(rows)
        if n_more > 0:
            rows.append(f'<tr><td colspan="{len(names)}">{n_more} more changes</td></tr>')
        return (
            f"<table><caption>{caption}</caption><thead><tr>{head}</tr></thead>"
            f"<tbody>{''.join(rows)}</tbody></table>"
        )

    def plot(self, axes: Sequence[Axes] | None = None) -> Sequence[Axes]:
        """Draws the measured position and that of the twin along x and y, with each confirmed
        fault from its onset to its confirmation, into two `axes` of matplotlib; returns them.

        Raises ValueError without evidence, and ImportError without matplotlib, which comes with
        `offbd[plot]`.
        """
        if self.evidence is None:
            raise ValueError("only a verdict with evidence can be drawn: replay(…, evidence=True)")
        if axes is None:
            axes = _new_axes()
        evidence = self.evidence.to_pydict()
        for axis, name in zip(axes, ("x", "y"), strict=True):
            _draw_motion(axis, evidence, name)
            for fault in _confirmed(self.faults):
                if fault.get("axis") in (name, None):
                    _draw_fault(axis, fault)
            axis.set_ylabel(f"{name}, m")
            axis.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize="small")
        axes[0].set_title(self.summary["session"])
        axes[-1].set_xlabel("time, s")
        return axes


def _html_row(fault: doc.Fault) -> str:
    kind = fault.get("kind") or ""
    onset_s = fault.get("onset_s")
    began = "" if onset_s is None else f"{onset_s:.2f}"
    cells = (f"{fault['t_s']:.2f}", fault["code"], kind, fault["status"], began, _causes(fault))
    title = escape(fault["summary"], quote=True)
    return f'<tr title="{title}">' + "".join(f"<td>{escape(cell)}</td>" for cell in cells) + "</tr>"


def _causes(fault: doc.Fault) -> str:
    """The possible causes of a fault with their weights, the likeliest first."""
    causes = sorted(fault["candidates"], key=lambda cause: -cause["weight"])
    names = (" ".join(filter(None, (c["code"], c.get("kind")))) for c in causes)
    return ", ".join(f"{n} {c['weight']:.0%}" for n, c in zip(names, causes, strict=True))


def _new_axes() -> Sequence[Axes]:
    try:
        from matplotlib import pyplot
    except ImportError as error:
        text = "a plot needs matplotlib, which `pip install offbd[plot]` installs"
        raise ImportError(text) from error
    _, (x, y) = pyplot.subplots(2, sharex=True, figsize=(9, 5), layout="constrained")
    return [x, y]


def _draw_motion(axis: Axes, evidence: dict[str, list[Any]], name: str) -> None:
    """Draws both positions along an axis, at each time at which the evidence was renewed. A gap in
    the readings is a gap in the line.
    """
    t_s = evidence["t_s"]
    measured, twin = evidence[f"{name}_position_m"], evidence[f"{name}_twin_position_m"]
    rows = [i for i, time_s in enumerate(t_s) if i == 0 or time_s != t_s[i - 1]]
    known = [i for i in rows if twin[i] is not None]
    axis.plot([t_s[i] for i in known], [twin[i] for i in known], "C1", lw=1.0, label="twin")
    values = [float("nan") if measured[i] is None else measured[i] for i in rows]
    axis.plot([t_s[i] for i in rows], values, "C0", lw=1.0, label="measured")


def _confirmed(faults: Sequence[doc.Fault]) -> list[doc.Fault]:
    """The first line of each code with the status confirmed, with the kind of the last one."""
    found: dict[str, doc.Fault] = {}
    for fault in faults:
        if fault["status"] == "confirmed":
            first = found.setdefault(fault["code"], fault)
            found[fault["code"]] = {**first, "kind": fault.get("kind") or first.get("kind")}
    return list(found.values())


def _draw_fault(axis: Axes, fault: doc.Fault) -> None:
    onset_s = fault.get("onset_s")
    label = " ".join(filter(None, (fault["code"], fault.get("kind"))))
    if onset_s is not None:
        axis.axvspan(onset_s, fault["t_s"], color="C3", alpha=0.15, linewidth=0.0)
    axis.axvline(fault["t_s"], color="C3", linewidth=1.2, label=f"{label}\nconfirmed")
