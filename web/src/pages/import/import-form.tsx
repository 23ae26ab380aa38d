import { api } from "../../api/client";
import type { FileInspection } from "../../api/types";
import { useQuery } from "../../hooks/use-query";
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
}

/** The samples per second of the chosen rig. */
function useRate(name: string, known: string[]): number | undefined {
  const isKnown = known.includes(name);
  const { data } = useQuery(
    () => (isKnown ? api.asset(name) : Promise.resolve(undefined)),
    `${name} ${isKnown}`,
  );
  return data?.sample_rate_hz;
}

/** Imports a file whose columns are assigned here. */
export function ImportForm({ file, inspection, inspecting, ...props }: Props) {
  const { problem, isBusy, reading, change, setColumns, setRate } = inspecting;
  const { rate } = reading;
  const { target, send } = useImport(props);
  const rigRate = useRate(target.asset, target.assets);
  const mapping = mappingOf(inspection);
  const isText = inspection.columns.length > 0;
  const hasTime = mapping.t_s !== "" && mapping.t_s !== LEFT_OUT;
  return (
    <>
      <ImportTarget {...target} />
      {isText && <MappingTable inspection={inspection} change={change} />}
      {isText && !hasTime && <RateField rate={rate} setRate={setRate} />}
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
        send={() => send(file, isText ? { columns: columnsParameter(mapping), rate } : {})}
        cancel={props.cancel}
      />
    </>
  );
}
