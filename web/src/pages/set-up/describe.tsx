import { useRef, useState } from "preact/hooks";
import { api } from "../../api/client";
import type { Asset } from "../../api/types";
import { useRefusal } from "../../parts/login/rights";
import { BallFields } from "./ball-fields";
import { assetOf, describeAsset, type Description } from "./description";
import { DiagnosisFields } from "./diagnosis-fields";
import { NameFields } from "./name-fields";
import { PlateFields } from "./plate-fields";
import { problemText } from "./problem-text";
import { UnitFields } from "./unit-fields";

interface Props {
  /** The registered rig; missing if it is new. */
  asset?: Asset;
  saved: (name: string) => void | Promise<void>;
  /** Opens the next step; not called if another step or page was opened while the form was saved. */
  next: (name: string) => void;
}

export function Describe({ asset, saved, next }: Props) {
  const form = useRef<HTMLFormElement>(null);
  const [description, setDescription] = useState(() => describeAsset(asset));
  const set = (part: Partial<Description>) => setDescription((before) => ({ ...before, ...part }));
  const [error, setError] = useState<unknown>();
  const [isBusy, setBusy] = useState(false);
  const refused = useRefusal("operator");
  // The browser has checked the fields and marked those that are empty or out of range.
  const submit = async (event: Event) => {
    event.preventDefault();
    setBusy(true);
    setError(undefined);
    try {
      const wanted = assetOf(description, asset);
      await (asset ? api.putAsset(wanted, asset) : api.createAsset(wanted));
      await saved(description.name);
      if (form.current) next(description.name);
    } catch (thrown) {
      setError(thrown);
    }
    setBusy(false);
  };
  const fields = { description, set };
  return (
    <form ref={form} class="card" onSubmit={submit}>
      <p>
        Measure the ball and the plate and enter them here: verdicts depend on them. The calibration finds the
        rest.
      </p>
      <NameFields {...fields} isRegistered={asset !== undefined} />
      <BallFields {...fields} />
      <PlateFields {...fields} />
      <UnitFields {...fields} />
      <DiagnosisFields {...fields} />
      <div class="form-end">
        {error !== undefined && (
          <span class="trouble-inline" role="alert">
            {problemText(error)}
          </span>
        )}
        <button type="submit" class="primary" disabled={isBusy || refused !== undefined} title={refused}>
          {asset ? "Save and continue" : "Register and continue"}
        </button>
      </div>
    </form>
  );
}
