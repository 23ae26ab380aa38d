import { useEffect, useState } from "preact/hooks";
import { api } from "../../api/client";
import { errorText } from "../../api/request";
import type { FileInspection, FileReading } from "../../api/types";
import { columnsParameter, mappingOf, type Mapping } from "./mapping";

/** Largest file, bytes; also the default limit of the service. */
const MAX_BYTES = 128 << 20;

/** A name for the rig of a file before one is chosen; it need not exist. */
const ANY_RIG = "any";

/**
 * Lets the service read a file without importing it, as the files of a rig if one is chosen; again after each
 * change of the mapping, which ends the reading before. What was found last stays meanwhile.
 */
export function useInspection(file: File, rig: string | undefined) {
  const [reading, setReading] = useState<FileReading>({});
  const [inspection, setInspection] = useState<FileInspection>();
  const [problem, setProblem] = useState<string>();
  const [isBusy, setBusy] = useState(true);
  useEffect(() => {
    const superseded = new AbortController();
    const isLatest = () => !superseded.signal.aborted;
    const found = async () => {
      if (file.size > MAX_BYTES) throw new Error("The file is larger than 128 MiB. Split it.");
      return api.inspectRecording(rig ?? ANY_RIG, file, reading, superseded.signal);
    };
    setBusy(true);
    setProblem(undefined);
    found()
      .then(
        (result) => isLatest() && setInspection(result),
        (error: unknown) => isLatest() && setProblem(errorText(error)),
      )
      .finally(() => isLatest() && setBusy(false));
    return () => superseded.abort();
  }, [file, rig, reading]);
  const setColumns = (columns: string) => setReading((before) => ({ ...before, columns }));
  const change = (part: Partial<Mapping>) =>
    inspection && setColumns(columnsParameter({ ...mappingOf(inspection), ...part }));
  const setRate = (rate: number | undefined) => setReading((before) => ({ ...before, rate }));
  return { inspection, problem, isBusy, reading, change, setColumns, setRate };
}

export type Inspecting = ReturnType<typeof useInspection>;
