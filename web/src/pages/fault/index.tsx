/** The page of one fault: evidence, possible causes, record and history. */
import { useEffect } from "preact/hooks";
import { api } from "../../api/client";
import { fleetEvents } from "../../api/events";
import type { FaultCode } from "../../api/types";
import { useLatest } from "../../hooks/use-latest";
import { useQuery } from "../../hooks/use-query";
import { useTitle } from "../../hooks/use-title";
import { UnloadedPage } from "../../parts/unloaded-page";
import { codeTitle } from "../../words/fault-names";
import { FaultDetails } from "./fault-details";

/** Polling interval, ms; events report changes earlier. */
const INTERVAL_MS = 5000;

export function FaultPage({ name, code }: { name: string; code: FaultCode }) {
  useTitle(`${codeTitle(code)} of ${name}`);
  const fault = useQuery(() => api.fault(name, code), `${name} ${code}`, INTERVAL_MS);
  const fetchHistory = () => api.history(name, code).then((page) => page.items);
  const history = useQuery(fetchHistory, `${name} ${code} history`, INTERVAL_MS);
  const refetch = () => Promise.all([fault.refetch(), history.refetch()]);
  const latestRefetch = useLatest(refetch);
  useEffect(() => {
    return fleetEvents.listen((line) => {
      if (line.asset === name && line.code === code) void latestRefetch.current();
    });
  }, [name, code, latestRefetch]);
  if (!fault.data)
    return (
      <UnloadedPage
        title={codeTitle(code)}
        what="the fault"
        kind="fault"
        error={fault.error}
        retry={refetch}
      />
    );
  const error = fault.error ?? history.error;
  return <FaultDetails fault={fault.data} history={history.data ?? []} error={error} refetch={refetch} />;
}
