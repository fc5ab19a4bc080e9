//! Cache of the aim of a view.

use crate::integrator::View;
use crate::math::UVec2;
use crate::scene::{Aim, Camera};
use std::sync::{Arc, Mutex};

/// The aim of the last view, cached from pass to pass.
#[derive(Clone, Debug, Default)]
pub(crate) struct AimCache(Arc<Mutex<Option<CachedAim>>>);

#[derive(Debug)]
struct CachedAim {
    camera: Camera,
    frame: UVec2,
    aim: Arc<Aim>,
}

impl AimCache {
    /// The aim for the camera and frame of a view, from the cache or else from `find`.
    pub(crate) fn aim(&self, view: &View<'_>, find: impl FnOnce() -> Aim) -> Arc<Aim> {
        let sensor = &view.sensor;
        let lock = || self.0.lock().unwrap_or_else(|e| e.into_inner());
        let same = |kept: &&CachedAim| kept.frame == sensor.frame && kept.camera == *sensor.camera;
        let found = lock().as_ref().filter(same).map(|kept| kept.aim.clone());
        if let Some(aim) = found {
            return aim;
        }
        // Without the lock: a thread that waits in `find` for its light paths may enter this function again.
        let aim = Arc::new(find());
        *lock() = Some(CachedAim {
            camera: sensor.camera.clone(),
            frame: sensor.frame,
            aim: aim.clone(),
        });
        aim
    }
}
