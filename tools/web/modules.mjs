// Finds npm modules in this folder's node_modules or, when they are installed elsewhere, along
// NODE_PATH (which import statements do not look at).
import { createRequire } from 'node:module';
import { existsSync } from 'node:fs';
import path from 'node:path';
import { fileURLToPath } from 'node:url';

const here = path.dirname(fileURLToPath(import.meta.url));

/** Folder of an installed npm module, or null. */
export function moduleFolder(name) {
  const along = (process.env.NODE_PATH ?? '').split(path.delimiter).filter(Boolean);
  const roots = [path.join(here, 'node_modules'), ...along];
  return roots.map((root) => path.join(root, name)).find((folder) => existsSync(folder)) ?? null;
}

/** Loads a CommonJS module; ends the program with status 77 ("skipped" to ctest) when it is missing. */
export function requireModule(name) {
  const folder = moduleFolder(name);
  if (folder === null) {
    console.error(`${name} is not installed: run npm ci in ${here}, or set NODE_PATH`);
    process.exit(77);
  }
  return createRequire(import.meta.url)(folder);
}
