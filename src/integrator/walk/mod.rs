//! Steps that every estimator borrows; each estimator keeps its own loop.
//!
//! | file | step |
//! |---|---|
//! | [`shading_point`] | light sampled from a vertex, emission found by a roughened lobe, the continuation |
//! | [`roughening`] | roughness at next-event estimation, and the memory of a rule |
//! | `pending_emission` | the weight of emission at the end of the current ray |
//! | `bodies` | bodies around the path, and what they absorb |
//! | `dispersion` | the colour channel of a path that met a dispersive interface |
//! | `roulette` | Russian roulette |
//! | `tile` | camera rays of all pixels of a tile |
//! | `cone` | a Dirac lobe spread over a cone |
//! | [`observer`] | callbacks for layers, statistics and training |

pub(super) mod bodies;
pub(super) mod cone;
pub(super) mod dispersion;
pub mod observer;
pub(super) mod pending_emission;
pub mod roughening;
pub(super) mod roulette;
pub mod shading_point;
pub(super) mod tile;
