/** The formats of files of recordings. */
import { ProblemError } from "./request";

export type FormatName = "csv" | "json" | "parquet" | "arrow" | "mcap" | "xlsx";

interface Format {
  word: string;
  mediaType: string;
  /** The feature of the build that has the format; missing if every build has it. */
  feature?: string;
}

/** The formats by the suffix of a file's name. */
export const FORMATS: Record<FormatName, Format> = {
  csv: { word: "CSV", mediaType: "text/csv" },
  json: { word: "JSON", mediaType: "application/json" },
  parquet: { word: "Parquet", mediaType: "application/vnd.apache.parquet", feature: "parquet" },
  arrow: { word: "Arrow", mediaType: "application/vnd.apache.arrow.stream", feature: "parquet" },
  mcap: { word: "MCAP", mediaType: "application/vnd.mcap", feature: "mcap" },
  xlsx: {
    word: "Excel",
    mediaType: "application/vnd.openxmlformats-officedocument.spreadsheetml.sheet",
    feature: "xlsx",
  },
};

/** The formats in which the service sends a recording. */
export const WRITTEN: FormatName[] = ["csv", "json", "parquet", "arrow", "mcap"];

/** The status code of a format that the service does not have. */
const NOT_ACCEPTABLE = 406;

/** Returns `error` in words if it says that the service is built without the format, otherwise as it is. */
export function formatError(error: unknown, name: FormatName): unknown {
  const { word, feature } = FORMATS[name];
  const isRefused = error instanceof ProblemError && error.status === NOT_ACCEPTABLE;
  if (!isRefused || !feature) return error;
  return new Error(
    `This service is built without ${word} files. Use CSV, or ask for a build with the feature “${feature}”.`,
  );
}

/** Does `action` with a file in a format; an error about the format is told in words. */
export const withFormat = async <T>(name: FormatName, action: () => Promise<T>): Promise<T> => {
  try {
    return await action();
  } catch (error) {
    throw formatError(error, name);
  }
};
