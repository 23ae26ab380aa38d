import type { Trends } from "../../../api/types";
import { codeTitle } from "../../../words/fault-names";
import { sentence } from "../../../words/sentence";

/** Warnings of drifting parameters at the top of the rig's page. */
export function TrendWarnings({ trends }: { trends?: Trends }) {
  const warnings = trends?.trends.flatMap((trend) => trend.warning ?? []) ?? [];
  if (!warnings.length) return null;
  return (
    <ul class="banner-list" aria-label="Drift warnings">
      {warnings.map(({ code, parameter, summary }) => (
        <li>
          <a href="#drift" class="banner">
            <span class="chip chip-drift">
              <b>
                {codeTitle(code)}, {parameter}
              </b>{" "}
              <span>drifts</span>
            </span>{" "}
            <span>{sentence(summary)}</span>
          </a>
        </li>
      ))}
    </ul>
  );
}
