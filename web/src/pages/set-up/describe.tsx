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
  /** The rig as it is described so far; missing where it is new. */
  asset?: Asset;
  done: (name: string) => void;
}

export function Describe({ asset, done }: Props) {
  const [description, setDescription] = useState(() => describeAsset(asset));
  const set = (part: Partial<Description>) => setDescription((before) => ({ ...before, ...part }));
  const keep = async () => {
    const wanted = assetOf(description, asset);
    await (asset ? api.putAsset(wanted) : api.createAsset(wanted));
    done(description.name);
  };
  const fields = { description, set };
  return (
    <form class="card" onSubmit={(e) => e.preventDefault()}>
      <p>
        What you know on day one. What is left as it is, is the book chapter's rig; the rest is learnt later.
      </p>
      <NameFields {...fields} isRegistered={asset !== undefined} />
      <BallFields {...fields} />
      <PlateFields {...fields} />
      <UnitFields {...fields} />
      <div class="form-end">
        <ActionButton class="primary" action={keep} disabled={!isName(description.name)}>
          {asset ? "Keep and go on" : "Register and go on"}
        </ActionButton>
      </div>
    </form>
  );
}
