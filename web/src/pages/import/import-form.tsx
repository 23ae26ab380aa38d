import { useMemo } from "preact/hooks";
import { api } from "../../api/client";
import { useQuery } from "../../hooks/use-query";
import { ColumnMapping } from "./column-mapping";
import { countSeen, finite, toColumns, toCsv } from "./columns";
import { ImportButtons } from "./import-buttons";
import { ImportTarget } from "./import-target";
import type { Mapping } from "./mapping";
import { Preview } from "./preview";
import { SanityCheck } from "./sanity-check";
import { useImport, type ImportProps } from "./use-import";
import type { RecordingFile } from "./use-recording-file";

interface Props extends ImportProps {
  recording: RecordingFile;
  setMapping: (mapping: Mapping) => void;
}

/** Samples per second of a rig that is not described yet. */
const DEFAULT_RATE_HZ = 100;

/** The samples per second of the chosen rig. */
function useRate(name: string, known: string[]): number {
  const isKnown = known.includes(name);
  const { data } = useQuery(
    () => (isKnown ? api.asset(name) : Promise.resolve(undefined)),
    `${name} ${isKnown}`,
  );
  return data?.sample_rate_hz ?? DEFAULT_RATE_HZ;
}

/** Imports a table whose columns are assigned here. */
export function ImportForm({ recording, setMapping, ...props }: Props) {
  const { table, mapping } = recording;
  const columns = useMemo(() => toColumns(table, mapping), [table, mapping]);
  const { target, send } = useImport(props);
  const rate = useRate(target.asset, target.assets);
  return (
    <>
      <ImportTarget {...target} />
      <ColumnMapping table={table} mapping={mapping} change={setMapping} />
      <Preview columns={columns} />
      <SanityCheck rate={rate} columns={columns} mapping={mapping} change={setMapping} />
      <ImportButtons
        mapping={mapping}
        nRows={finite(columns.t_s).length}
        nSeen={countSeen(columns)}
        hasAsset={target.asset !== ""}
        send={() => send(toCsv(columns), "csv")}
        cancel={props.cancel}
      />
    </>
  );
}
