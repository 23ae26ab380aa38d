import { NumberInput, type FieldsProps } from "./number-input";

/** The name of the rig, which is fixed after the registration, and its sample rate. */
export function NameFields({ isRegistered, ...fields }: FieldsProps & { isRegistered: boolean }) {
  const { description, set } = fields;
  return (
    <fieldset>
      <legend>The rig</legend>
      <div class="form-row">
        <label>
          Name{" "}
          <input
            value={description.name}
            disabled={isRegistered}
            required
            pattern="[A-Za-z0-9._\-]+"
            title="Letters, digits, “-”, “_” and “.”"
            maxLength={128}
            placeholder="bench-1"
            onInput={(e) => set({ name: e.currentTarget.value })}
            aria-describedby="name-rule"
          />
        </label>
        <NumberInput {...fields} field="rate" label="Sample rate" unit="Hz" />
      </div>
      <p id="name-rule" class="quiet small-text">
        The name consists of letters, digits, “-”, “_” and “.”. A rig cannot be renamed: its name identifies
        it in recordings, in the audit log and in the configurations of its devices.
      </p>
    </fieldset>
  );
}
