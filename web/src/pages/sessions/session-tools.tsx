import { tagApi } from "../../api/tags";
import { useQuery } from "../../hooks/use-query";
import { TagChoice } from "../../parts/tag-choice";
import { navigate } from "../../router/navigation";
import { sessionsPath } from "../../router/paths";
import { RigChoice } from "./rig-choice";

interface Props {
  /** The names of all rigs. */
  names: string[];
  asset: string;
  tag: string;
}

/** Selects sessions by their rig and by a tag. */
export function SessionTools({ names, asset, tag }: Props) {
  const { data: tags } = useQuery(tagApi.inUse, "tags");
  return (
    <>
      <RigChoice names={names} chosen={asset} tag={tag} />
      <TagChoice
        tags={tags ?? []}
        chosen={tag}
        change={(chosen) => navigate(sessionsPath(asset, chosen), true)}
      />
    </>
  );
}
