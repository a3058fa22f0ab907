// three.js as the page has it, under the name by which modules import it: the player can be tested with nothing installed.

import { register } from 'node:module';

const three = new URL('../../vendor/three/three.module.min.js', import.meta.url).href;
const hook = `export const resolve = async (name, context, next) => (name === 'three' ? { url: '${three}', shortCircuit: true } : next(name, context));`;
register(`data:text/javascript,${encodeURIComponent(hook)}`);
