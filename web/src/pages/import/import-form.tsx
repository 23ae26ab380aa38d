import { useMemo, useState } from "preact/hooks";
import { api } from "../../api/client";
import type { ImportResult } from "../../api/types";
import { navigate } from "../../router/navigation";
import { sessionPath } from "../../router/paths";
import { ColumnMapping } from "./column-mapping";
import { countSeen, finite, toColumns, toCsv } from "./columns";
import { ImportButtons } from "./import-buttons";
import { ImportTarget } from "./import-target";
import type { Mapping } from "./mapping";
import { Preview } from "./preview";
import { SanityCheck } from "./sanity-check";
import type { RecordingFile } from "./use-recording-file";

interface Props {
  recording: RecordingFile;
  setMapping: (mapping: Mapping) => void;
  fileName: string;
  assets: string[];
  wantedAsset?: string;
  /** Called with the result if not all rows were accepted. */
  imported: (result: ImportResult) => void;
  cancel: () => void;
}

const withoutExtension = (name: string) => name.replace(/\.\w+$/, "");

export function ImportForm({
  recording,
  setMapping,
  fileName,
  assets,
  wantedAsset,
  imported,
  cancel,
}: Props) {
  const { table, mapping } = recording;
  const columns = useMemo(() => toColumns(table, mapping), [table, mapping]);
  const [asset, setAsset] = useState(wantedAsset ?? "");
  const [session, setSession] = useState(withoutExtension(fileName));
  const send = async () => {
    if (!assets.includes(asset)) await api.createAsset({ name: asset });
    const result = await api.importCsv(asset, session, toCsv(columns));
    if (result.rejected + result.late === 0) navigate(sessionPath(result.session.id));
    else imported(result);
  };
  return (
    <>
      <ImportTarget
        assets={assets}
        asset={asset}
        setAsset={setAsset}
        session={session}
        setSession={setSession}
      />
      <ColumnMapping table={table} mapping={mapping} change={setMapping} />
      <Preview columns={columns} />
      <SanityCheck columns={columns} mapping={mapping} change={setMapping} />
      <ImportButtons
        mapping={mapping}
        nRows={finite(columns.t_s).length}
        nSeen={countSeen(columns)}
        hasAsset={asset !== ""}
        send={send}
        cancel={cancel}
      />
    </>
  );
}
