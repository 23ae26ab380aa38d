/** The dialog for importing a file as a session: column mapping, preview and checks. */
import { useState } from "preact/hooks";
import { api } from "../../api/client";
import type { ImportResult } from "../../api/types";
import { useQuery } from "../../hooks/use-query";
import { Dialog } from "../../parts/dialog";
import { ImportForm } from "./import-form";
import { ImportOutcome } from "./import-outcome";
import { useInspection } from "./use-inspection";

interface Props {
  file: File;
  /** Number of files that were dropped with it and are not imported. */
  nOthers: number;
  /** The names of all rigs. */
  assets: string[];
  /** The rig that the list of sessions is filtered by, if any. */
  asset?: string;
  close: () => void;
}

export function ImportDialog({ file, nOthers, assets, asset, close }: Props) {
  const [rig, setRig] = useState(asset ?? "");
  const isKnown = assets.includes(rig);
  const { data: known } = useQuery(
    () => (isKnown ? api.asset(rig) : Promise.resolve(undefined)),
    `${rig} ${isKnown}`,
  );
  const inspecting = useInspection(file, known?.columns ? rig : undefined);
  const { inspection, problem, isBusy } = inspecting;
  const [result, setResult] = useState<ImportResult>();
  const target = {
    fileName: file.name,
    assets,
    asset: rig,
    setAsset: setRig,
    imported: setResult,
    cancel: close,
  };
  return (
    <Dialog title={`Import ${file.name}`} close={close}>
      {nOthers > 0 && (
        <p class="note" role="status">
          Only {file.name} was taken; import files one by one.
        </p>
      )}
      {problem && !inspection && (
        <p class="trouble" role="alert">
          {problem}
        </p>
      )}
      {isBusy && !inspection && (
        <p class="quiet" role="status">
          Reading the file…
        </p>
      )}
      {result && <ImportOutcome result={result} />}
      {!result && inspection && (
        <ImportForm
          file={file}
          inspection={inspection}
          inspecting={inspecting}
          rigRate={known?.sample_rate_hz}
          {...target}
        />
      )}
    </Dialog>
  );
}
