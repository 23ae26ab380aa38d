import { useState } from "preact/hooks";
import { api } from "../../api/client";
import type { Asset } from "../../api/types";
import { ActionButton } from "../../parts/action-button";
import { BallFields } from "./ball-fields";
import { assetOf, describeAsset, isName, type Description } from "./description";
import { NameFields } from "./name-fields";
import { PlateFields } from "./plate-fields";
import { UnitFields } from "./unit-fields";

interface Props {
  /** The registered rig; missing if it is new. */
  asset?: Asset;
  done: (name: string) => void;
}

export function Describe({ asset, done }: Props) {
  const [description, setDescription] = useState(() => describeAsset(asset));
  const set = (part: Partial<Description>) => setDescription((before) => ({ ...before, ...part }));
  const save = async () => {
    const wanted = assetOf(description, asset);
    await (asset ? api.putAsset(wanted) : api.createAsset(wanted));
    done(description.name);
  };
  const fields = { description, set };
  return (
    <form class="card" onSubmit={(e) => e.preventDefault()}>
      <p>Enter what you know. The defaults are those of the book chapter's rig; the rest is learnt later.</p>
      <NameFields {...fields} isRegistered={asset !== undefined} />
      <BallFields {...fields} />
      <PlateFields {...fields} />
      <UnitFields {...fields} />
      <div class="form-end">
        <ActionButton class="primary" action={save} disabled={!isName(description.name)}>
          {asset ? "Save and continue" : "Register and continue"}
        </ActionButton>
      </div>
    </form>
  );
}
