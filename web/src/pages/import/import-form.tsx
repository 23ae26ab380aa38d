import { useState } from "preact/hooks";
import type { FileInspection } from "../../api/types";
import { FileColumns } from "./file-columns";
import { FileRemarks } from "./file-remarks";
import { ImportButtons } from "./import-buttons";
import { ImportTarget } from "./import-target";
import { columnsParameter, LEFT_OUT, mappingOf } from "./mapping";
import { MappingTable } from "./mapping-table";
import { MappingText } from "./mapping-text";
import { Preview } from "./preview";
import { RateField } from "./rate-field";
import { useImport, type ImportProps } from "./use-import";
import type { Inspecting } from "./use-inspection";

interface Props extends ImportProps {
  file: File;
  inspection: FileInspection;
  inspecting: Inspecting;
  /** The samples per second of the chosen rig. */
  rigRate?: number;
}

/** Imports a file whose columns are assigned here. */
export function ImportForm({ file, inspection, inspecting, rigRate, ...props }: Props) {
  const { problem, isBusy, reading, change, setColumns, setRate } = inspecting;
  const { rate } = reading;
  const { target, send } = useImport(props);
  const [isKept, setKept] = useState(false);
  const mapping = mappingOf(inspection);
  const isText = inspection.columns.length > 0;
  const hasTime = mapping.t_s !== "" && mapping.t_s !== LEFT_OUT;
  return (
    <>
      <ImportTarget {...target} />
      {isText && <MappingTable inspection={inspection} change={change} />}
      {isText && !hasTime && <RateField rate={rate} setRate={setRate} />}
      {isText && inspection.mapping !== "" && (
        <label class="check">
          <input type="checkbox" checked={isKept} onChange={(e) => setKept(e.currentTarget.checked)} /> Save
          this mapping for further files
        </label>
      )}
      {isText && <MappingText mapping={reading.columns ?? columnsParameter(mapping)} change={setColumns} />}
      {isText && <FileColumns columns={inspection.columns} isOpen={inspection.rows === 0} />}
      {inspection.rows > 0 && <Preview inspection={inspection} />}
      <FileRemarks inspection={inspection} rate={rigRate} change={change} />
      <ImportButtons
        inspection={inspection}
        problem={problem}
        isBusy={isBusy}
        lacksRate={!hasTime && rate === undefined}
        hasAsset={target.asset !== ""}
        send={() => send(file, isText ? { columns: columnsParameter(mapping), rate } : {}, isKept)}
        cancel={props.cancel}
      />
    </>
  );
}
