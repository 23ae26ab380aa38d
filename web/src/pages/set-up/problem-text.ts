/** Errors of the service about a description, in the words and units of the form. */
import { errorText, ProblemError } from "../../api/request";

/** The fields by the element of the asset file that they describe. */
const FIELDS: Record<string, { label: string; unit: string; factor: number }> = {
  "/name": { label: "Name", unit: "", factor: 1 },
  "/sample_rate_hz": { label: "Sample rate", unit: "Hz", factor: 1 },
  "/ball/radius_m": { label: "Radius", unit: "mm", factor: 1e3 },
  "/ball/mass_kg": { label: "Mass", unit: "g", factor: 1e3 },
  "/plate/length_m": { label: "Length along x", unit: "mm", factor: 1e3 },
  "/plate/width_m": { label: "Width along y", unit: "mm", factor: 1e3 },
  "/plate/diameter_m": { label: "Diameter", unit: "mm", factor: 1e3 },
  "/diagnostics/debounce_s": { label: "Debounce time", unit: "s", factor: 1 },
  "/diagnostics/false_alarms_per_rig_year": { label: "Accepted false servo alarms", unit: "", factor: 1 },
  "/servo/angle_limit_rad": { label: "Largest plate angle", unit: "°", factor: 180 / Math.PI },
};

/** A number, and the unit of the asset file if the text has it. */
const NUMBER = /(-?\d+(?:\.\d+)?(?:e[+-]?\d+)?)(?: (?:m|kg|rad)\b)?/gi;

const rounded = (n: number) => String(Number(n.toPrecision(4))).replace("-", "−");

/** Returns the text of an error, with the field that it is about and its values in the unit of the form. */
export function problemText(error: unknown): string {
  const text = errorText(error);
  const pointer = error instanceof ProblemError ? pointerOf(error) : undefined;
  const field = pointer === undefined ? undefined : FIELDS[pointer];
  if (!field) return text;
  const reason = text.replace(`${pointer}: `, "");
  if (field.factor === 1) return `${field.label}: ${reason}`;
  const inUnit = reason.replace(
    NUMBER,
    (_, value) => `${rounded(Number(value) * field.factor)}\u202f${field.unit}`,
  );
  return `${field.label}: ${inUnit}`;
}

/** The element that a problem is about, by its member or the beginning of its text. */
function pointerOf({ problem, message }: ProblemError): string | undefined {
  const { pointer } = problem as { pointer?: string | null };
  return pointer || /^(\/[\w/]+): /.exec(message)?.[1];
}
