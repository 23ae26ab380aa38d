import { HOLLOW, SOLID } from "./description";
import { NumberInput, type FieldsProps } from "./number-input";

export function BallFields(fields: FieldsProps) {
  const { inertia } = fields.description;
  return (
    <fieldset>
      <legend>Ball</legend>
      <div class="form-row">
        <NumberInput {...fields} field="radius" label="Radius" unit="mm" />
        <NumberInput {...fields} field="mass" label="Mass" unit="g" />
        <label>
          Kind{" "}
          <select value={inertia} onChange={(e) => fields.set({ inertia: Number(e.currentTarget.value) })}>
            <option value={SOLID}>solid</option>
            <option value={HOLLOW}>hollow</option>
            {![SOLID, HOLLOW].includes(inertia) && <option value={inertia}>inertia factor {inertia}</option>}
          </select>
        </label>
      </div>
    </fieldset>
  );
}
