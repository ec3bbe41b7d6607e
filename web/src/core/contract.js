/** The numbers that Python and JavaScript share; build/contract.js writes them into this file of the npm package. */

import contract from "../../../src/anyprobe/contract.json" with { type: "json" };

export const CONTRACT = contract;
