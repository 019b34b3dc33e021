// Reads of the API of the same origin, with the cookie of the visitor.

/** The JSON at an address of the API; a refusal is thrown with the sentence that the API gives. */
export async function read(address) {
  const answer = await fetch(address, { credentials: "same-origin", headers: { accept: "application/json" } });
  if (answer.status === 401) throw new Error("You are no longer signed in. Open the page again to sign in.");
  const body = await answer.json().catch(() => null);
  if (!answer.ok) throw new Error(body?.detail ?? `The service answered with ${answer.status}.`);
  return body;
}
