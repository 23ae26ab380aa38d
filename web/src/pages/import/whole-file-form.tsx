import { FORMATS, type FormatName } from "../../api/formats";
import { ActionButton } from "../../parts/action-button";
import { ImportTarget } from "./import-target";
import { QUANTITIES } from "./quantities";
import { useImport, type ImportProps } from "./use-import";

interface Props extends ImportProps {
  file: File;
  format: FormatName;
}

/** What the service expects in a file that it reads itself. */
function Expected({ format }: { format: FormatName }) {
  if (format === "mcap")
    return (
      <p>
        The service reads this MCAP file as it is: its samples are the JSON messages of the schema{" "}
        <code>offbd.Sample</code>.
      </p>
    );
  return (
    <p>
      The service reads this {FORMATS[format].word} file as it is
      {format === "xlsx" && ", its first sheet"}: the columns must have the names{" "}
      <code>{QUANTITIES.join(", ")}</code>, in seconds, radians and metres
      {format === "xlsx" && "; a time may be a date"}. With other names or units, save it as CSV: then its
      columns can be assigned here.
    </p>
  );
}

/** Imports a file that the service reads itself. */
export function WholeFileForm({ file, format, ...props }: Props) {
  const { target, send } = useImport(props);
  return (
    <>
      <ImportTarget {...target} />
      <Expected format={format} />
      <div class="form-end">
        <span class="late" role="status">
          {!target.asset && "Choose the rig."}
        </span>
        <button type="button" onClick={props.cancel}>
          Cancel
        </button>
        <ActionButton
          class="primary"
          action={() => send(file, format)}
          disabled={!target.asset}
          needs="operator"
        >
          Import the file
        </ActionButton>
      </div>
    </>
  );
}
