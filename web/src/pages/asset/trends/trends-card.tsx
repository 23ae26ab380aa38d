import type { Trends } from "../../../api/types";
import type { Query } from "../../../hooks/use-query";
import { ErrorMessage } from "../../../parts/error-message";
import { Loading } from "../../../parts/loading";
import { TrendCharts } from "./trend-charts";

/** The trends of both servos: estimates per session, fitted lines, and limits. */
export function TrendsCard({ query: { data, error, refetch } }: { query: Query<Trends> }) {
  return (
    <section class="card" id="drift">
      <h2>Drift over sessions</h2>
      <ErrorMessage error={error} retry={refetch} />
      {!data && !error && <Loading what="the trends" />}
      {data && <TrendCharts trends={data} />}
    </section>
  );
}
