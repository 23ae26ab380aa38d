import { useState } from "preact/hooks";
import { api } from "../../api/client";
import { FORMATS, withFormat, WRITTEN, type FormatName } from "../../api/formats";
import type { Session } from "../../api/types";
import { ActionButton } from "../../parts/action-button";
import { Choice } from "../../parts/choice";
import { saveFile } from "../../parts/save-file";
import { useFeature } from "../../parts/service-health";

/** Downloads the recording of a session as a file of the chosen format. */
export function Download({ session: { id, name, asset } }: { session: Session }) {
  const [format, setFormat] = useState<FormatName>("csv");
  const isBuilt = useFeature();
  const options = WRITTEN.filter((each) => isBuilt(FORMATS[each].feature)).map(
    (each) => [each, FORMATS[each].word] as const,
  );
  const download = async () =>
    saveFile(await withFormat(format, () => api.recording(id, format)), `${asset}-${name}.${format}`);
  return (
    <>
      <Choice isInline label="Format" options={options} value={format} change={setFormat} />
      <ActionButton action={download}>Download {FORMATS[format].word}</ActionButton>
    </>
  );
}
