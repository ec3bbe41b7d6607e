/** Hashes of the graphs in weights/, written by build/weights.js. */

export const INTEGRITY = {
  light: "sha384-4BGeB2w0LMgEJoqrqQTjp0iuDBt9ezgkwAyJCTiWk++52Lhovyqb5/Ibog/yZ1Ah",
  mask: "sha384-l8v28V32hRB8OJXN3UT+8EjhwjAz9nPJxI2BQmqGpllNP0SrI+TbAdsNJ1sabtQe",
};
