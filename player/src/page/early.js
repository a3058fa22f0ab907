// What takes time and needs no page: runs before three.js is there.

import { prepare } from '../spawn.js';

if (location.search) prepare(Math.min(navigator.hardwareConcurrency || 2, 4));
