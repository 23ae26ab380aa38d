/** The numbers at one moment, as a table: the innovation record or a freeze frame. */
import type { Evidence } from "../api/types";
import { degrees, millimetres, number, seconds } from "../words";

export function EvidenceTable({ of }: { of: Evidence }) {
  const axes = [of.x, of.y];
  const residual = (axis: Evidence["x"]) => axis.residual_m_s2 ?? null;
  const rows: [string, string[]][] = [
    ["Command behind the axis", axes.map((a) => degrees(a.command_rad, 2))],
    ["Position", axes.map((a) => millimetres(a.position_m))],
    ["Velocity", axes.map((a) => number(a.velocity_m_s, 3, "m/s"))],
    ["Measured acceleration", axes.map((a) => number(a.measured_m_s2, 3, "m/s²"))],
    ["Twin's acceleration", axes.map((a) => number(a.twin_m_s2, 3, "m/s²"))],
    ["Residual", axes.map((a) => number(residual(a), 3, "m/s²"))],
    ["Limit", axes.map((a) => number(a.limit_m_s2, 3, "m/s²"))],
    ["Gate", axes.map((a) => (a.enabled ? "open" : "closed"))],
  ];
  const beyond = (a: Evidence["x"]) => a.enabled && Math.abs(residual(a) ?? 0) >= a.limit_m_s2;
  return (
    <>
      <div class="scroll" tabIndex={0} role="region" aria-label="Numbers at that moment">
        <table class="numbers">
          <thead><tr><th scope="col">at {seconds(of.t_s)}</th><th scope="col" class="n">x</th><th scope="col" class="n">y</th></tr></thead>
          <tbody>{rows.map(([name, cells]) => (
            <tr><th scope="row">{name}</th>{cells.map((cell, i) => <td class={`n${name === "Residual" && beyond(axes[i]!) ? " bad" : ""}`}>{cell}</td>)}</tr>
          ))}</tbody>
        </table>
      </div>
      <p class="quiet small-text">
        Window {seconds(of.window_s)}; no ball seen for {seconds(of.unseen_s)}; readings identical for {seconds(of.identical_s)};
        ball at rest for {seconds(of.still_s)}; {of.outliers} readings set aside in 10 s; scatter {millimetres(of.scatter_m, 2)}.
      </p>
    </>
  );
}
