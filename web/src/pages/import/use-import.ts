import { useState } from "preact/hooks";
import { api } from "../../api/client";
import type { FileReading, ImportResult } from "../../api/types";
import { fetchRigNames } from "../../hooks/use-rig-names";
import { navigate } from "../../router/navigation";
import { sessionPath } from "../../router/paths";

export interface ImportProps {
  fileName: string;
  /** The names of all rigs. */
  assets: string[];
  asset: string;
  setAsset: (name: string) => void;
  /** Called with the result if not all rows were accepted, or if there are several sessions. */
  imported: (result: ImportResult) => void;
  cancel: () => void;
}

const withoutExtension = (name: string) => name.replace(/\.\w+$/, "");

/** Where a recording is imported to, and its import, which registers the rig if it is new. */
export function useImport({ fileName, assets, asset, setAsset, imported }: ImportProps) {
  const [session, setSession] = useState(withoutExtension(fileName));
  /** Imports the file; `isKept` tells whether further files of the rig are read in the same way. */
  const send = async (file: File, reading: FileReading, isKept: boolean) => {
    const columns = isKept ? reading.columns : undefined;
    // The page's list of rigs may not be read yet.
    if (!(await fetchRigNames()).includes(asset)) {
      await api.createAsset({ name: asset, columns });
    } else if (columns) {
      const before = await api.asset(asset);
      await api.putAsset({ ...before, columns }, before);
    }
    const result = await api.importRecording(asset, session, file, reading);
    if (result.rejected + result.late === 0 && !result.more_sessions?.length)
      navigate(sessionPath(result.session.id));
    else imported(result);
  };
  return { target: { assets, asset, setAsset, session, setSession }, send };
}
