import type { ComponentChildren } from "preact";
import { api } from "../../api/client";
import { useQuery } from "../../hooks/use-query";
import { Link } from "../../router/link";
import { dateTime } from "../../words/time";

interface Props {
  title: string;
  /** The page of which this is the report. */
  back: string;
  children: ComponentChildren;
}

/** The head and foot of a report: when, and by which version, it was made. */
export function ReportFrame({ title, back, children }: Props) {
  const { data: health } = useQuery(api.health, "health");
  return (
    <main class="report">
      <header class="page-head">
        <h1>{title}</h1>
        <div class="page-tools no-print">
          <Link class="button" to={back}>
            Back
          </Link>
          <button type="button" class="primary" onClick={() => print()}>
            Print
          </button>
        </div>
      </header>
      {children}
      <p class="report-foot quiet small-text">
        Report of {dateTime(new Date().toISOString())}, offbd {health?.version ?? ""}
      </p>
    </main>
  );
}
