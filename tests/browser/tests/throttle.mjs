// Who guesses has to wait; last, for then nobody signs in as grace from this machine for some seconds.
import assert from "node:assert/strict";

async function who_guesses_passwords_has_to_wait({ browser }) {
  const page = await browser.page(await browser.context(), "#/sign-in", [/status of 4(01|29)/]);
  for (let i = 0; i < 8; i++) {
    await page.getByLabel("Name").fill("grace");
    await page.getByLabel("Password", { exact: true }).fill(`guess number ${i}`);
    await page.getByRole("button", { name: "Sign in" }).click();
    await page.locator(".form-fault", { hasText: /Too many|do not match/ }).waitFor();
    await page.locator("button[type=submit]:enabled").waitFor();
  }
  assert.match(await page.locator(".form-fault").innerText(), /Too many attempts. Try again in \d+ second/);
}

export const tests = [who_guesses_passwords_has_to_wait];
