import { useState } from "preact/hooks";
import { ActionButton } from "../../parts/action-button";
import { ProfileChoice } from "./profile-choice";
import type { ReplayForm } from "./replay-settings";

/** The form for the settings with which a session is judged again. */
export function ReplayFields({ judge }: { judge: (form: ReplayForm) => Promise<void> }) {
  const [form, setForm] = useState<ReplayForm>({
    profile: "textbook",
    debounce: "",
    isUnlearnt: false,
    isPresent: false,
  });
  const set = (part: Partial<ReplayForm>) => setForm((before) => ({ ...before, ...part }));
  return (
    <div class="form-row">
      <ProfileChoice label="Profile" chosen={form.profile} choose={(profile) => set({ profile })} />
      <label>
        Debounce, s{" "}
        <input
          type="number"
          min="0"
          max="60"
          step="0.1"
          placeholder="as recorded"
          value={form.debounce}
          onInput={(e) => set({ debounce: e.currentTarget.value })}
        />
      </label>
      <label class="check">
        <input
          type="checkbox"
          checked={form.isUnlearnt}
          onChange={(e) => set({ isUnlearnt: e.currentTarget.checked })}
        />{" "}
        without the calibration
      </label>
      <label class="check">
        <input
          type="checkbox"
          checked={form.isPresent}
          onChange={(e) => set({ isPresent: e.currentTarget.checked })}
        />{" "}
        with the rig as described now
      </label>
      <ActionButton class="primary" action={() => judge(form)} needs="operator">
        Judge again
      </ActionButton>
    </div>
  );
}
