/** The requests about the tags of rigs. */
import { editionOf, get, getAll, segment, send } from "./request";
import type { components } from "../../generated/schema";
import type { TagUse } from "./types";

export type Tags = components["schemas"]["Tags"];

export const tagApi = {
  /** The tags in use, in alphabetical order. */
  inUse: () => getAll<TagUse>("/tags", {}).then((uses) => uses.map(({ tag }) => tag)),
  of: (asset: string) => get<Tags>(`/assets/${segment(asset)}/tags`),
  /** Replaces the tags `before`, as they were fetched. */
  put: (asset: string, tags: string[], before: Tags) =>
    send<Tags>("PUT", `/assets/${segment(asset)}/tags`, { tags }, editionOf(before)),
};
