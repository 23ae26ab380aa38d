import type { Summary } from "../api/types";
import { Link } from "../router/link";
import { setUpPath } from "../router/paths";
import { capitalised } from "../words/sentence";

interface Props {
  /** Missing while the session is open. */
  verdict?: Pick<Summary, "warnings"> | null;
  /** The rig whose description may be wrong. */
  asset: string;
}

const asSentence = (text: string) => `${capitalised(text)}${text.endsWith("?") ? "" : "."}`;

/** What does not fit between the samples of a session and the description of its rig, such as a wrong unit. */
export function VerdictWarnings({ verdict, asset }: Props) {
  const warnings = verdict?.warnings ?? [];
  if (!warnings.length) return null;
  return (
    <section class="trouble warnings" aria-label="Warnings">
      <b>The samples and the description of the rig do not fit:</b>
      <ul>
        {warnings.map(({ message }) => (
          <li>{asSentence(message)}</li>
        ))}
      </ul>
      <Link to={setUpPath(asset, "describe")}>Look at the description of the rig</Link>
    </section>
  );
}
