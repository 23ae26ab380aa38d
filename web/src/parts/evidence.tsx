/** The numbers at one moment, as a table: the innovation record or a freeze frame. */
import type { Evidence } from "../api/types";
import { degrees, millimetres, number, seconds } from "../words";

export function EvidenceTable({ of }: { of: Evidence }) {
  const axes = [of.x, of.y];
  const residual = (axis: Evidence["x"]) => axis.residual_m_s2 ?? null;
  const answer = (show: (a: NonNullable<Evidence["x"]["answer"]>) => string) =>
    axes.map((a) => (a.answer ? show(a.answer) : number(null, 0)));
  const about = (value: number, error: number, digits: number, unit = "") =>
    `${number(value, digits)} ± ${number(error, digits, unit)}`;
  const rows: [string, string[]][] = [
    ["Command behind the axis", axes.map((a) => degrees(a.command_rad, 2))],
    ["Position", axes.map((a) => millimetres(a.position_m))],
    ["Velocity", axes.map((a) => number(a.velocity_m_s, 3, "m/s"))],
    ["Measured acceleration", axes.map((a) => number(a.measured_m_s2, 3, "m/s²"))],
    ["Twin's acceleration", axes.map((a) => number(a.twin_m_s2, 3, "m/s²"))],
    ["Residual", axes.map((a) => number(residual(a), 3, "m/s²"))],
    ["Limit", axes.map((a) => number(a.limit_m_s2, 3, "m/s²"))],
    ["Gate", axes.map((a) => (a.enabled ? "open" : "closed"))],
    ["Evidence against the servo", axes.map((a) => number(a.nats, 1, "nats"))],
    ["Path off the twin's over 2 s", axes.map((a) => millimetres(a.path_error_m))],
    ...(axes.some((a) => a.answer)
      ? [
          ["Answers this share of its command", answer((a) => about(a.gain, a.gain_error, 2))] as [
            string,
            string[],
          ],
          [
            "Acceleration that nothing asks for",
            answer((a) => about(a.offset_m_s2, a.offset_error_m_s2, 2, "m/s²")),
          ] as [string, string[]],
          [
            "Delay beyond the twin's",
            answer((a) => about(a.delay_s * 1e3, a.delay_error_s * 1e3, 0, "ms")),
          ] as [string, string[]],
        ]
      : []),
  ];
  const beyond = (a: Evidence["x"]) => a.enabled && Math.abs(residual(a) ?? 0) >= a.limit_m_s2;
  return (
    <>
      <div class="scroll" tabIndex={0} role="region" aria-label="Numbers at that moment">
        <table class="numbers">
          <thead>
            <tr>
              <th scope="col">at {seconds(of.t_s)}</th>
              <th scope="col" class="n">
                x
              </th>
              <th scope="col" class="n">
                y
              </th>
            </tr>
          </thead>
          <tbody>
            {rows.map(([name, cells]) => (
              <tr>
                <th scope="row">{name}</th>
                {cells.map((cell, i) => (
                  <td class={`n${name === "Residual" && beyond(axes[i]!) ? " bad" : ""}`}>{cell}</td>
                ))}
              </tr>
            ))}
          </tbody>
        </table>
      </div>
      <p class="quiet small-text">
        Window {seconds(of.window_s)}; no ball seen for {seconds(of.unseen_s)}; readings identical for{" "}
        {seconds(of.identical_s)}; ball at rest for {seconds(of.still_s)}; {of.outliers} readings set aside in
        10 s; scatter {millimetres(of.scatter_m, 2)}
        {of.healthy_scatter_m ? `, of healthy readings ${millimetres(of.healthy_scatter_m, 2)}` : ""}
        {of.jump ? `; readings stepped by ${millimetres(of.jump.size_m, 0)} at ${seconds(of.jump.t_s)}` : ""}.
      </p>
    </>
  );
}
