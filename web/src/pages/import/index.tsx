/** The dialog for importing a file as a session: column mapping, preview and checks. */
import { useState } from "preact/hooks";
import type { ImportResult } from "../../api/types";
import { Dialog } from "../../parts/dialog";
import { ImportForm } from "./import-form";
import { ImportOutcome } from "./import-outcome";
import { useRecordingFile } from "./use-recording-file";

interface Props {
  file: File;
  /** The names of all rigs. */
  assets: string[];
  /** The rig that the list of sessions is filtered by, if any. */
  asset?: string;
  close: () => void;
}

export function ImportDialog({ file, assets, asset, close }: Props) {
  const { recording, problem, setMapping } = useRecordingFile(file);
  const [result, setResult] = useState<ImportResult>();
  return (
    <Dialog title={`Import ${file.name}`} close={close}>
      {problem && (
        <p class="trouble" role="alert">
          {problem}
        </p>
      )}
      {!problem && !recording && (
        <p class="quiet" role="status">
          Reading the file…
        </p>
      )}
      {result && <ImportOutcome result={result} />}
      {!result && recording && (
        <ImportForm
          recording={recording}
          setMapping={setMapping}
          fileName={file.name}
          assets={assets}
          wantedAsset={asset}
          imported={setResult}
          cancel={close}
        />
      )}
    </Dialog>
  );
}
