//! All integration tests, in one binary so that the library is linked once.

mod agree;
mod anisotropy;
mod aov;
mod appearance;
mod architecture;
mod backs;
mod bench;
mod bidirectional;
mod boundaries;
mod bsdf;
mod chaos;
mod clearcoat;
mod cli;
mod compare;
mod dispersion;
mod energy;
mod examples;
mod export;
mod exr;
mod film;
#[cfg(feature = "scenes")]
mod foreign;
mod fuzz;
mod geometry;
mod guided;
mod instances;
mod lamps;
mod lens;
mod levels;
mod load;
mod manifold;
mod many_lights;
mod mean_error;
mod media;
mod metric;
mod mollifier;
mod nested;
mod options;
mod panes;
mod parts;
mod pilot;
#[cfg(feature = "train")]
mod readme;
mod references;
mod resume;
mod sampler;
mod scenes;
mod stability;
#[cfg(feature = "train")]
mod stability_train;
mod statement;
mod stop;
mod support;
mod surface;
mod table_file;
#[cfg(feature = "train")]
mod train;
mod training_scenes;
mod transport;
#[cfg(feature = "view")]
mod view;
mod witness;
