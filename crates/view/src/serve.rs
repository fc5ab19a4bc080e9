//! The server: access control, and answers to requests.
//!
//! It listens on the loopback interface only. Every address begins with a secret token. The `Host` header must name
//! this server, so that DNS names of other sites give no access; so must `Origin`, if a browser sends it.

use super::connections::{Connections, Place};
use super::film::{self, Film};
use super::http::{Answer, Connection, End, MAX_BODY, Request};
use super::hub::{Frame, Hub, State};
use super::open_scene::{OpenScene, Viewpoint};
use super::options::{CONTROLS, Message, Overlay};
use super::paint::painted_picture;
use super::save;
use super::scene_file::{Dropped, MAX_BYTES};
use opsr::image::denoise::Denoiser;
use opsr::math::{UVec2, Vec3};
use opsr::render::look::Look;
use opsr::render::value::{Field, LensChoice};
use opsr::render::{Fault, Names, OPTIONS};
use serde::Deserialize;
use serde_json::{Value, json};
use std::net::{TcpListener, TcpStream};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::Duration;

/// Longest wait for something new, and maximum number of waiting clients: a browser opens six connections to a server,
/// which all of its windows share. Other clients are answered at once and ask again later.
const POLL: Duration = Duration::from_secs(5);
const MAX_WAITING: usize = 3;

/// Files of the page: name, kind, and contents.
const FILES: [(&str, &str, &str); 8] = [
    (
        "",
        "text/html; charset=utf-8",
        include_str!("page/index.html"),
    ),
    (
        "page.css",
        "text/css; charset=utf-8",
        include_str!("page/page.css"),
    ),
    (
        "camera.js",
        "text/javascript; charset=utf-8",
        include_str!("page/camera.js"),
    ),
    (
        "page.js",
        "text/javascript; charset=utf-8",
        include_str!("page/page.js"),
    ),
    (
        "pixel.js",
        "text/javascript; charset=utf-8",
        include_str!("page/pixel.js"),
    ),
    (
        "curve.js",
        "text/javascript; charset=utf-8",
        include_str!("page/curve.js"),
    ),
    (
        "film.js",
        "text/javascript; charset=utf-8",
        include_str!("page/film.js"),
    ),
    (
        "drop.js",
        "text/javascript; charset=utf-8",
        include_str!("page/drop.js"),
    ),
];

/// State from which the server answers.
pub(super) struct Server {
    pub(super) hub: Arc<Hub>,
    pub(super) token: String,
    pub(super) port: u16,
    /// Threads for queries about pixels.
    pub(super) pool: rayon::ThreadPool,
    /// Clients that wait for something new.
    pub(super) waiting: AtomicUsize,
    /// Files that were dropped onto a page.
    pub(super) dropped: Dropped,
    /// Held while dropped files are received and opened, so that drops are handled one by one.
    pub(super) opening: Mutex<()>,
}

/// A pixel in a message.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Pick {
    x: u32,
    y: u32,
    /// `target` turns the camera to the point, `focus` puts it in focus.
    what: String,
}

impl Server {
    /// Answers clients until the viewer ends.
    pub(super) fn listen(self: &Arc<Self>, listener: &TcpListener) {
        let connections = Arc::new(Connections::default());
        for stream in listener.incoming() {
            if self.hub.ended() {
                return;
            }
            let Ok(stream) = stream else {
                // The limit of open files may be reached: some will close.
                std::thread::sleep(Duration::from_millis(20));
                continue;
            };
            let Some(place) = Connections::admit(&connections, &stream) else {
                if let Ok(mut connection) = Connection::new(stream) {
                    let full = Answer::text(503, "too many connections");
                    let _ = connection.send(&full, false);
                }
                continue;
            };
            let server = self.clone();
            // If no thread can start, the connection is closed and its place is free again.
            let thread = std::thread::Builder::new().stack_size(1 << 20);
            let _ = thread.spawn(move || server.serve(stream, &place));
        }
    }

    fn serve(&self, stream: TcpStream, place: &Place) {
        let Ok(mut connection) = Connection::new(stream) else {
            return;
        };
        while !self.hub.ended() {
            let refusal = match self.answered(&mut connection, place) {
                Ok(answer) => {
                    if connection.send(&answer, true).is_err() {
                        return;
                    }
                    continue;
                }
                Err(End::Refused(refusal)) => refusal,
                Err(End::Gone) => return,
            };
            let _ = connection.send(&refusal, false);
            return connection.close();
        }
    }

    /// The answer to the next request. The body is read only if the client has access.
    fn answered(&self, connection: &mut Connection, place: &Place) -> Result<Answer, End> {
        let mut request = connection.next()?;
        let path = self.permitted(&request).map_err(End::Refused)?.to_owned();
        place.keep();
        let answer = match (request.method.as_str(), path.as_str()) {
            ("POST", "open") => {
                let busy = || End::Refused(Answer::text(503, "another file is being opened"));
                let _alone = self.opening.try_lock().map_err(|_| busy())?;
                connection.body(&mut request, MAX_BYTES)?;
                self.open(&mut request)
            }
            _ => {
                connection.body(&mut request, MAX_BODY)?;
                self.answer(&path, &request)
            }
        };
        Ok(answer.unwrap_or_else(|refusal| refusal))
    }

    /// The path below the token; a refusal for a client without access.
    fn permitted<'a>(&self, request: &'a Request) -> Result<&'a str, Answer> {
        let port = self.port;
        let hosts = [format!("127.0.0.1:{port}"), format!("localhost:{port}")];
        if !(request.host.as_ref()).is_some_and(|host| hosts.contains(host)) {
            return Err(Answer::text(403, "this server has another name"));
        }
        if let Some(origin) = &request.origin
            && !hosts.iter().any(|host| *origin == format!("http://{host}"))
        {
            return Err(Answer::text(403, "pages of other origins get nothing here"));
        }
        let unknown = || Answer::text(404, "no such page; the address is printed by `opsr view`");
        let rest = request.path.strip_prefix('/').ok_or_else(unknown)?;
        let (token, path) = rest.split_once('/').ok_or_else(unknown)?;
        match equal(token.as_bytes(), self.token.as_bytes()) {
            true => Ok(path),
            false => Err(unknown()),
        }
    }

    fn answer(&self, path: &str, request: &Request) -> Result<Answer, Answer> {
        if let Some((_, kind, text)) = FILES.iter().find(|(name, ..)| *name == path) {
            return match request.method.as_str() {
                "GET" => Ok(Answer::new(200, kind, *text)),
                _ => Err(Answer::text(405, "not a method of this page")),
            };
        }
        let get = [
            "facts",
            "poll",
            "film",
            "pixel",
            "object",
            "paths",
            "picture.png",
            "picture.exr",
            "look.json",
        ];
        let post = ["set", "pick", "open"];
        match request.method.as_str() {
            "GET" if get.contains(&path) => self.get(path, request),
            "POST" if post.contains(&path) => self.post(path, request),
            _ if get.contains(&path) || post.contains(&path) => {
                Err(Answer::text(405, "not a method of this page"))
            }
            _ => Err(Answer::text(404, "no such page")),
        }
    }

    fn get(&self, path: &str, request: &Request) -> Result<Answer, Answer> {
        let number = |key| {
            request
                .asks(key)
                .and_then(|text| text.parse().ok())
                .unwrap_or(0)
        };
        Ok(match path {
            "facts" => Answer::json(200, &self.facts()),
            "poll" => self.poll(number("frame"), number("words")),
            "film" => self.film(number("film"), number("change")),
            "pixel" => Answer::json(200, &self.pixel(self.asked_pixel(request)?)),
            "object" => {
                let (viewpoint, pixel) = (self.viewpoint()?, self.asked_pixel(request)?);
                Answer::json(200, &viewpoint.object_at(pixel))
            }
            "paths" => {
                let (viewpoint, pixel) = (self.viewpoint()?, self.asked_pixel(request)?);
                Answer::json(200, &self.pool.install(|| viewpoint.paths(pixel)))
            }
            "look.json" => {
                let look = self.hub.lock().options.look;
                let text = look.map(|look| self.with_lens(look).file());
                let text = text.ok_or_else(|| Answer::text(503, "there is no camera yet"))?;
                Answer {
                    file: Some("view.json".into()),
                    ..Answer::new(200, "application/json", text)
                }
            }
            name => {
                let kept = self.hub.request_film();
                let kept = kept.ok_or_else(|| Answer::text(503, "there is no picture yet"))?;
                let bytes = save::encoded(kept, name).map_err(|fault| refusal(&fault))?;
                let kind = if name.ends_with("png") {
                    "image/png"
                } else {
                    "image/x-exr"
                };
                Answer {
                    file: Some(name.to_owned()),
                    ..Answer::new(200, kind, bytes)
                }
            }
        })
    }

    fn post(&self, path: &str, request: &Request) -> Result<Answer, Answer> {
        let kind = request.content_type.as_deref().unwrap_or_default();
        if !kind.starts_with("application/json") {
            return Err(Answer::text(415, "a message is application/json"));
        }
        let bad = |e: serde_json::Error| Answer::text(400, format!("not a message: {e}"));
        if path == "pick" {
            let pick = serde_json::from_slice(&request.body).map_err(bad)?;
            return self.pick(&pick);
        }
        let message: Message = serde_json::from_slice(&request.body).map_err(bad)?;
        let updated = self.hub.update(|options| options.after(message));
        updated.map_err(|fault| refusal(&fault))?;
        Ok(Answer::json(200, &json!({ "ok": true })))
    }

    /// Opens files that were dropped onto a page. If they cannot be read, the current scene stays.
    fn open(&self, request: &mut Request) -> Result<Answer, Answer> {
        if request.content_type.as_deref() != Some("application/octet-stream") {
            return Err(Answer::text(415, "files are application/octet-stream"));
        }
        let message = std::mem::take(&mut request.body);
        let file = self.dropped.unpacked(&message);
        drop(message);
        let file = Arc::new(file.map_err(|fault| refusal(&fault))?);
        let options = self.hub.lock().options.with_file(file.clone());
        let options = options.map_err(|fault| refusal(&fault))?;
        let open_scene = OpenScene::of(&options).map_err(|fault| refusal(&fault))?;
        self.hub.change(|state| {
            state.open_scene = Some(Arc::new(open_scene));
            state.film = None;
        });
        let opened = self.hub.update(|options| options.with_file(file));
        opened.map_err(|fault| refusal(&fault))?;
        Ok(Answer::json(200, &json!({ "ok": true })))
    }

    /// Turns the camera to the point under a pixel, or focuses on it.
    fn pick(&self, pick: &Pick) -> Result<Answer, Answer> {
        let viewpoint = self.viewpoint()?;
        let pixel = UVec2::new(pick.x, pick.y);
        let inside = pixel.cmplt(viewpoint.frame).all();
        let hit = if inside { viewpoint.point(pixel) } else { None };
        let (_, point, depth) = hit.ok_or_else(|| Answer::text(400, "there is nothing"))?;
        let message = match pick.what.as_str() {
            "target" => {
                let look = self.hub.lock().options.look;
                let look = look.ok_or_else(|| Answer::text(503, "there is no camera yet"))?;
                json!({ "look": turned(look, point) })
            }
            "focus" => {
                let held = self
                    .hub
                    .lock()
                    .options
                    .spec
                    .lens
                    .map(|lens| lens.radius)
                    .or(viewpoint.camera.lens.map(|lens| lens.radius));
                // A lens with visible blur: a hundredth of the distance.
                let radius = held.filter(|a| *a > 0.0).unwrap_or(0.01 * depth);
                let focus = Some(depth);
                json!({ "options": { "lens": LensChoice { radius, focus }.text() } })
            }
            _ => return Err(Answer::text(400, "expected `target` or `focus`")),
        };
        let message =
            serde_json::from_value(message).map_err(|e| Answer::text(400, e.to_string()))?;
        self.hub
            .update(|options| options.after(message))
            .map_err(|fault| refusal(&fault))?;
        Ok(Answer::json(
            200,
            &json!({ "point": point.to_array(), "depth": depth }),
        ))
    }

    fn viewpoint(&self) -> Result<Arc<Viewpoint>, Answer> {
        let shown = self.hub.lock().shown.clone();
        let shown = shown.ok_or_else(|| Answer::text(503, "there is no picture yet"))?;
        Ok(shown.viewpoint.clone())
    }

    fn asked_pixel(&self, request: &Request) -> Result<UVec2, Answer> {
        let frame = self.viewpoint()?.frame;
        let number = |key| request.asks(key).and_then(|text| text.parse().ok());
        let pixel = number("x").zip(number("y")).map(|(x, y)| UVec2::new(x, y));
        let inside = pixel.filter(|pixel| pixel.cmplt(frame).all());
        inside.ok_or_else(|| Answer::text(400, "expected x and y of a pixel"))
    }

    /// The look with the lens of the options.
    fn with_lens(&self, look: Look) -> Look {
        let state = self.hub.lock();
        let viewpoint = state.shown.as_ref().map(|shown| shown.viewpoint.clone());
        let lens = viewpoint
            .as_ref()
            .and_then(|viewpoint| viewpoint.camera.lens);
        Look {
            aspect: viewpoint.map(|viewpoint| viewpoint.frame.x as f32 / viewpoint.frame.y as f32),
            aperture: lens.map(|lens| lens.radius),
            focus: lens.map(|lens| lens.focus),
            ..look
        }
    }

    /// The values of a pixel, and its surface.
    fn pixel(&self, pixel: UVec2) -> Value {
        let (shown, other) = {
            let state = self.hub.lock();
            (state.shown.clone(), state.other.clone())
        };
        let Some(shown) = shown else {
            return Value::Null;
        };
        let at = |size: UVec2| {
            let place = pixel * size / shown.viewpoint.frame;
            (place.y * size.x + place.x) as usize
        };
        let index = at(shown.size);
        let of = |map: &Option<Vec<f32>>| map.as_ref().and_then(|m| m.get(index).copied());
        let other = other.filter(|other| other.run == shown.run);
        json!({
            "pixel": pixel.to_array(),
            "radiance": shown.picture.pixels.get(index).map(|p| p.to_array()),
            "other": other.and_then(|o| o.picture.pixels.get(at(o.size)).map(|p| p.to_array())),
            "reference": (self.hub.reference.as_ref())
                .filter(|r| r.pixels.len() == shown.picture.pixels.len())
                .and_then(|r| r.pixels.get(index)).map(|p| p.to_array()),
            "error": of(&shown.maps.error),
            "noise": of(&shown.maps.noise),
            "bias": of(&shown.maps.bias),
            "level": shown.maps.level.as_ref().and_then(|l| l.get(index)),
            "surface": shown.viewpoint.describe(pixel),
        })
    }

    /// Facts that do not change while the page is open.
    fn facts(&self) -> Value {
        let open_scene = self.hub.lock().open_scene.clone();
        let cameras: Vec<String> = (open_scene.iter())
            .flat_map(|open_scene| &open_scene.opened.scene.parts().cameras)
            .enumerate()
            .map(|(i, camera)| match camera.name.as_str() {
                "" => format!("{i}"),
                name => name.to_owned(),
            })
            .collect();
        let variants = open_scene
            .as_ref()
            .map(|open_scene| &open_scene.opened.variants);
        let seconds = open_scene.as_ref().map_or(0.0, |open| open.seconds());
        let (frames, rate) = film::pace(seconds);
        let file = self.hub.lock().options.file.clone();
        let bounds = open_scene.as_ref().map(|open_scene| {
            let (low, high) = open_scene.opened.scene.bounds();
            [low.to_array(), high.to_array()]
        });
        let options = OPTIONS
            .iter()
            .filter(|option| CONTROLS.contains(&option.name));
        let options: Vec<Value> = options
            .map(|option| {
                json!({
                    "name": option.name,
                    "flag": option.flag(),
                    "help": option.help(),
                    "choices": (option.names)(),
                    "default": option.default,
                })
            })
            .collect();
        json!({
            "title": file.title(),
            "scene": open_scene.as_ref().map(|_| file.path.display().to_string()),
            "version": env!("CARGO_PKG_VERSION"),
            "options": options,
            "overlays": Overlay::ALL.map(Overlay::name),
            "cameras": cameras,
            "variants": variants,
            "seconds": seconds,
            "frames": frames,
            "rate": rate,
            "bounds": bounds,
            "denoiser": Denoiser::open().is_ok(),
            "reference": self.hub.reference.is_some(),
        })
    }

    /// The newest frame and words, once one of them is newer than what the client has.
    fn poll(&self, frame: u64, words: u64) -> Answer {
        let (state, crowded) =
            self.wait(|state| state.frame_number != frame || state.status_version != words);
        let new = state.frame.clone().filter(|_| state.frame_number != frame);
        let mut head = json!({
            "frame": state.frame_number,
            "words": state.status_version,
            "state": state.status_json(),
            "crowded": crowded,
        });
        drop(state);
        let images = new.as_deref().map(images).unwrap_or_default();
        if let Some(frame) = &new {
            head["picture"] = frame.head.clone();
        }
        head["images"] = images
            .iter()
            .map(|image| json!(image.0.to_array()))
            .collect();
        with_pictures(&head, images.into_iter().map(|(_, bytes)| bytes))
    }

    /// Waits for something new; also true if too many clients wait, so that this one is answered at once.
    fn wait(&self, holds: impl Fn(&State) -> bool) -> (MutexGuard<'_, State>, bool) {
        let crowded = self.waiting.fetch_add(1, Ordering::SeqCst) >= MAX_WAITING;
        let most = if crowded { Duration::ZERO } else { POLL };
        let state = self.hub.wait(most, holds);
        self.waiting.fetch_sub(1, Ordering::SeqCst);
        (state, crowded)
    }

    /// The oldest change of a film after this one, once there is one: a frame, or the words alone.
    fn film(&self, film: u64, change: u64) -> Answer {
        let (mut state, crowded) = self.wait(|state| {
            let new = |of: &Film| of.number != film || of.is_newer(change);
            state.options.playing.is_none() || state.film.as_ref().is_some_and(new)
        });
        let spec = state.options.spec.clone();
        let (mut head, mut painted) = (json!({ "film": film, "crowded": crowded }), None);
        if let Some(of) = &mut state.film {
            let seen = if of.number == film { change } else { 0 };
            if let Some((change, frame, still)) = of.after(seen) {
                let display = of.display(&spec, &still.picture);
                head = json!({
                    "film": of.number,
                    "change": change,
                    "frame": frame,
                    "size": [still.picture.width, still.picture.height],
                    "round": still.round,
                    "samples": still.samples,
                    "command": still.command,
                    "crowded": crowded,
                });
                drop(state);
                painted = Some(painted_picture(&still.picture, display).bytes);
            }
        }
        with_pictures(&head, painted)
    }
}

/// An answer of words and pixels: the length of the words in four bytes, the words as JSON, the pixels.
fn with_pictures(head: &Value, pictures: impl IntoIterator<Item = Arc<[u8]>>) -> Answer {
    let head = head.to_string();
    let mut parts: Vec<Arc<[u8]>> = vec![
        (head.len() as u32).to_le_bytes().to_vec().into(),
        head.into_bytes().into(),
    ];
    parts.extend(pictures);
    Answer {
        status: 200,
        kind: "application/octet-stream",
        file: None,
        parts,
    }
}

/// Pictures of a frame.
fn images(frame: &Frame) -> Vec<(UVec2, Arc<[u8]>)> {
    let both = [Some(&frame.picture), frame.other.as_ref()];
    let both = both.into_iter().flatten();
    both.map(|image| (image.size, image.bytes.clone()))
        .collect()
}

/// A look from the same place at another point.
fn turned(look: Look, point: Vec3) -> Look {
    Look {
        target: point.to_array(),
        ..look
    }
}

/// A refusal with the option names of the command line.
fn refusal(fault: &Fault) -> Answer {
    Answer::text(400, fault.message(Names::Flags))
}

/// True for equal bytes; takes the same time wherever bytes of equal length differ.
fn equal(a: &[u8], b: &[u8]) -> bool {
    let differ = a.iter().zip(b).fold(0, |all, (x, y)| all | (x ^ y));
    a.len() == b.len() && differ == 0
}
