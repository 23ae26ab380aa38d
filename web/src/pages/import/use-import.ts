import { useRef, useState } from "preact/hooks";
import { api } from "../../api/client";
import type { ImportResult } from "../../api/types";
import { navigate } from "../../router/navigation";
import { sessionPath } from "../../router/paths";
import type { Reading } from "./use-inspection";

export interface ImportProps {
  fileName: string;
  /** The names of all rigs. */
  assets: string[];
  /** The rig that is proposed. */
  wantedAsset?: string;
  /** Called with the result if not all rows were accepted, or if there are several sessions. */
  imported: (result: ImportResult) => void;
  cancel: () => void;
}

const withoutExtension = (name: string) => name.replace(/\.\w+$/, "");

/** Where a recording is imported to, and its import, which registers the rig if it is new. */
export function useImport({ fileName, assets, wantedAsset = "", imported }: ImportProps) {
  const [asset, setAsset] = useState(wantedAsset);
  const [session, setSession] = useState(withoutExtension(fileName));
  /** Rigs that were registered for an import that has failed. */
  const registered = useRef<string[]>([]);
  const send = async (file: File, reading: Reading) => {
    if (![...assets, ...registered.current].includes(asset)) {
      await api.createAsset({ name: asset });
      registered.current.push(asset);
    }
    const result = await api.importRecording(asset, session, file, reading);
    if (result.rejected + result.late === 0 && !result.more_sessions?.length)
      navigate(sessionPath(result.session.id));
    else imported(result);
  };
  return { target: { assets, asset, setAsset, session, setSession }, send };
}
