//! A viewer in the browser: a page on this machine that shows a scene while it is rendered.
//!
//! | file | contents |
//! |---|---|
//! | `http` | requests and answers, bounded in size and time |
//! | `serve` | access control, and answers to requests |
//! | `connections` | a bounded number of open connections |
//! | `options` | options that pages set, checked |
//! | `hub` | the state that all threads share |
//! | `work` | the render thread |
//! | `finish` | the thread that makes pictures of films |
//! | `likeness` | FLIP over tiles, while a picture changes |
//! | `preview` | previews of fewer pixels than the frame |
//! | `film` | stored frames of animations |
//! | `play` | playback: frames of animations, rendered in rounds |
//! | `paint` | the thread that makes pixels of pictures |
//! | `scene_file` | the file of the scene, and files that are dropped onto a page |
//! | `open_scene` | values, surfaces and paths under the pointer |
//! | `save` | files of the current render |
//! | `page` | HTML, CSS and JavaScript of the page |
//!
//! Options are those of `opsr render`, by the same declarations. The picture equals that of `opsr render` with the same
//! options, camera and samples, bit for bit. Clients ask for the newest frame and wait for it: a slow client skips
//! frames, and a stalled one delays no other.

mod connections;
mod film;
mod finish;
mod http;
mod hub;
mod likeness;
mod open_scene;
mod options;
mod paint;
mod play;
mod preview;
mod save;
mod scene_file;
mod serve;
mod work;

use finish::Slot;
use hub::Hub;
use opsr::files::hex;
use opsr::image::exr;
use opsr::render::{Fault, Spec};
use options::Options;
use preview::Previews;
use scene_file::{Dropped, SceneFile};
use serve::Server;
use std::collections::HashMap;
use std::net::{Ipv4Addr, TcpListener, TcpStream};
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use work::Renderer;

/// A viewer of a scene that listens and does not render yet.
pub struct Viewer {
    listener: TcpListener,
    server: Arc<Server>,
}

impl Viewer {
    /// Listens on a port of the loopback interface; 0 takes a free port.
    ///
    /// Fails for conflicting options, a crop, a port in use, and a reference that cannot be read. Errors of the scene
    /// are shown on the page.
    pub fn open(
        file: &Path,
        spec: &Spec,
        port: u16,
        reference: Option<&Path>,
    ) -> Result<Self, Fault> {
        if spec.crop.is_some() {
            return Err(Fault::option("crop", "a viewer shows the whole frame"));
        }
        let reference = reference.map(exr::read_rgb).transpose()?;
        let named = Arc::new(SceneFile::named(file));
        let options = Options::new(spec, named, reference.is_some())?;
        let hub = Arc::new(Hub::new(options, reference));
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port));
        let failed = |e: std::io::Error| Fault::Output(format!("port {port}: {e}"));
        let listener = listener.map_err(failed)?;
        let port = listener.local_addr().map_err(failed)?.port();
        let mut token = [0; 16];
        getrandom::fill(&mut token)
            .map_err(|e| Fault::Output(format!("no random numbers: {e}")))?;
        let server = Arc::new(Server {
            hub,
            token: hex(&token),
            port,
            pool: one_thread()?,
            waiting: AtomicUsize::new(0),
            dropped: Dropped::default(),
            opening: Mutex::default(),
        });
        Ok(Self { listener, server })
    }

    /// The address of the page, with its access token: clients that have it can see the scene and change what is shown.
    pub fn address(&self) -> String {
        let Server { port, token, .. } = &*self.server;
        format!("http://127.0.0.1:{port}/{token}/")
    }

    /// Renders and answers requests until `stop` is set.
    pub fn run(self, stop: &AtomicBool) -> Result<(), Fault> {
        let Self { listener, server } = self;
        let (finishing, painting) = (one_thread()?, one_thread()?);
        let (hub, slot) = (server.hub.clone(), Arc::new(Slot::default()));
        let listening = server.clone();
        let serving = std::thread::spawn(move || listening.listen(&listener));
        let shared = (hub.clone(), slot.clone());
        std::thread::spawn(move || finish::run(&shared.0, &shared.1, &finishing));
        let shared = hub.clone();
        std::thread::spawn(move || paint::run(&shared, &painting));
        let shared = hub.clone();
        std::thread::spawn(move || {
            let mut renderer = Renderer {
                hub: &shared,
                slot: &slot,
                previews: Previews::default(),
                choices: HashMap::new(),
            };
            renderer.run();
        });
        while !stop.load(Ordering::Relaxed) {
            std::thread::sleep(Duration::from_millis(50));
        }
        hub.end();
        // Wakes the listening thread, which then returns. The other threads end by themselves after their current work.
        drop(TcpStream::connect((Ipv4Addr::LOCALHOST, server.port)));
        let _ = serving.join();
        server.dropped.remove();
        Ok(())
    }
}

/// A pool of one thread, which the system schedules beside the render's threads: its work does not queue behind theirs.
fn one_thread() -> Result<rayon::ThreadPool, Fault> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    pool.map_err(|e| Fault::Output(format!("cannot start a thread: {e}")))
}
