// Runs the Khronos glTF validator over files, one line each.
//
//   node tools/web/validate.mjs FILE.glb...
//
// Prints the counts of errors, warnings, infos and hints, then the first errors and warnings.
// Ends with 0 when no file has an error, 1 when one has, 77 when the validator is not installed.
import { readFile } from 'node:fs/promises';
import path from 'node:path';
import { requireModule } from './modules.mjs';

const validator = requireModule('gltf-validator');
const files = process.argv.slice(2);
if (files.length === 0) {
  console.error('usage: node validate.mjs FILE...');
  process.exit(2);
}

const kShown = 20;  // issues printed for one file

async function validate(file) {
  const bytes = new Uint8Array(await readFile(file));
  const folder = path.dirname(file);
  const report = await validator.validateBytes(bytes, {
    uri: path.basename(file),
    maxIssues: 0,  // no cap: hints would otherwise crowd out errors
    externalResourceFunction: async (uri) =>
      new Uint8Array(await readFile(path.join(folder, decodeURIComponent(uri)))),
  });
  const { numErrors, numWarnings, numInfos, numHints, messages } = report.issues;
  console.log(`${file}: ${numErrors} errors, ${numWarnings} warnings, ${numInfos} infos, ${numHints} hints`);
  const grave = messages.filter(({ severity }) => severity < 2);
  for (const { code, message, pointer, severity } of grave.slice(0, kShown))
    console.log(`  ${severity === 0 ? 'error' : 'warning'} ${code} ${pointer ?? ''}: ${message}`);
  if (grave.length > kShown) console.log(`  and ${grave.length - kShown} more`);
  return numErrors === 0;
}

let sound = true;
for (const file of files) {
  try {
    sound = (await validate(file)) && sound;
  } catch (error) {
    console.log(`${file}: unreadable: ${error.message ?? error}`);
    sound = false;
  }
}
process.exit(sound ? 0 : 1);
