/** The numbers that Python and JavaScript share; in the npm package they stand in this file, by build/contract.js. */

import contract from "../../../src/anyprobe/contract.json" with { type: "json" };

export const CONTRACT = contract;
