//! Light paths and connections: densities of the ends, algebra of the weights, agreement with the path tracer.

mod agreement;
mod aim;
mod blurred;
mod density;
mod determinism;
mod ends;
mod metropolis;
mod photons;
mod psr;
mod radii;
mod scenes;
mod slopes;
mod split;
mod strategies;
mod weights;
