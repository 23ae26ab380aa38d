import type { Learning } from "../../../api/types";

/** The gathered motion along each axis, of the required motion. */
export function MotionProgress({ learning: { x_s, y_s, wanted_s } }: { learning: Learning }) {
  const axes = [
    { axis: "x", gathered: x_s },
    { axis: "y", gathered: y_s },
  ].flatMap(({ axis, gathered }) =>
    gathered == null ? [] : [{ axis, seconds: Math.min(gathered, wanted_s) }],
  );
  return (
    <ul class="learning-axes">
      {axes.map(({ axis, seconds }) => (
        <li>
          <span>{axis}</span>
          <progress max={wanted_s} value={seconds} aria-label={`Motion along ${axis}`}>
            {Math.floor(seconds)} s
          </progress>
          <span class="quiet">
            {Math.floor(seconds)} of {Math.round(wanted_s)} s
          </span>
        </li>
      ))}
    </ul>
  );
}
