//! The viewer's protocol: valid clients, refused requests, stalled clients, and a picture that equals that of a render.

mod dropped;
mod film;

use opsr::image::exr;
use opsr::math::{Rgb, Vec3};
use opsr::render::look::CameraChoice;
use opsr::render::{Request, Spec, Subject, run};
use opsr::scene::{Scene, SceneParts};
use opsr_lab::gallery::{self, glb};
use opsr_lab::gallery::{materials, shapes};
use opsr_view::Viewer;
use serde_json::{Value, json};
use std::io::{Read, Write};
use std::net::TcpStream;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// A viewer that runs until it is dropped.
struct Running {
    folder: tempfile::TempDir,
    scene: PathBuf,
    port: u16,
    token: String,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Drop for Running {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let ended = self.thread.take().map(JoinHandle::join);
        assert!(std::thread::panicking() || ended.is_some_and(|e| e.is_ok()));
    }
}

/// A response.
#[derive(Debug)]
struct Answer {
    status: u16,
    head: String,
    body: Vec<u8>,
}

impl Answer {
    fn text(&self) -> String {
        String::from_utf8_lossy(&self.body).into_owned()
    }
}

fn spec(choices: &[(&str, Value)]) -> Spec {
    let mut spec = Spec::default();
    let usual = [("size", json!("24x16")), ("spp", json!(8))];
    for (name, value) in usual.iter().chain(choices) {
        spec.set(name, value).expect("an option");
    }
    spec
}

impl Running {
    fn new(choices: &[(&str, Value)]) -> Self {
        let scene = glb::to_glb(&gallery::caustic_box()).expect("a scene");
        Self::of(&scene, choices)
    }

    fn of(scene: &[u8], choices: &[(&str, Value)]) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("box.glb");
        std::fs::write(&file, scene).expect("a file");
        let viewer = Viewer::open(&file, &spec(choices), 0, None).expect("a viewer");
        let address = viewer.address();
        let rest = address.strip_prefix("http://127.0.0.1:").expect("loopback");
        let (port, token) = rest.split_once('/').expect("a token");
        let (port, token) = (port.parse().expect("a port"), token.trim_end_matches('/'));
        let token = token.to_owned();
        assert!(token.len() == 32, "{token}");
        let stop = Arc::new(AtomicBool::new(false));
        let flag = stop.clone();
        let thread = std::thread::spawn(move || viewer.run(&flag).expect("an end"));
        Self {
            folder,
            scene: file,
            port,
            token,
            stop,
            thread: Some(thread),
        }
    }

    fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(("127.0.0.1", self.port)).expect("a connection");
        let patience = Some(Duration::from_secs(20));
        stream.set_read_timeout(patience).expect("a time");
        stream
    }

    /// Sends bytes and reads the response.
    fn raw(&self, bytes: &[u8]) -> Answer {
        let mut stream = self.connect();
        // The server may close the connection before the last byte.
        let _ = stream.write_all(bytes);
        read(&mut stream)
    }

    fn request(&self, method: &str, path: &str, headers: &str, body: &str) -> Answer {
        let (token, port, length) = (&self.token, self.port, body.len());
        self.raw(
            format!(
                "{method} /{token}/{path} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nContent-Length: {length}\r\n{headers}\r\n{body}"
            )
            .as_bytes(),
        )
    }

    fn get(&self, path: &str) -> Answer {
        self.request("GET", path, "", "")
    }

    fn post(&self, path: &str, message: &Value) -> Answer {
        let kind = "Content-Type: application/json\r\n";
        self.request("POST", path, kind, &message.to_string())
    }

    fn json(&self, path: &str) -> Value {
        serde_json::from_slice(&self.get(path).body).expect("JSON")
    }

    /// The newest state, and the bytes of its pictures.
    fn poll(&self, frame: u64) -> (Value, Vec<u8>) {
        let body = self.get(&format!("poll?frame={frame}&words=0")).body;
        let length = u32::from_le_bytes(body[..4].try_into().expect("a length")) as usize;
        let head = serde_json::from_slice(&body[4..4 + length]).expect("JSON");
        (head, body[4 + length..].to_vec())
    }

    /// Polls until the newest state and picture satisfy a condition.
    fn until(&self, wanted: impl Fn(&Value) -> bool) -> (Value, Vec<u8>) {
        let end = Instant::now() + Duration::from_secs(60);
        loop {
            let (head, pixels) = self.poll(0);
            if wanted(&head) {
                return (head, pixels);
            }
            assert!(Instant::now() < end, "{head}");
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Waits until the finished render is on the page.
    fn done(&self) -> (Value, Vec<u8>) {
        self.until(|head| {
            let same = head["picture"]["run"] == head["state"]["run"];
            let whole = head["picture"]["samples"] == head["state"]["course"]["samples"];
            head["state"]["phase"] == "done" && same && whole && head["picture"]["samples"] != 0
        })
    }
}

fn read(stream: &mut TcpStream) -> Answer {
    let mut bytes = Vec::new();
    let mut piece = [0; 4096];
    let end = loop {
        if let Some(end) = bytes.windows(4).position(|w| w == b"\r\n\r\n") {
            break end + 4;
        }
        let count = stream.read(&mut piece).expect("an answer");
        assert!(count > 0, "closed without an answer");
        bytes.extend_from_slice(&piece[..count]);
    };
    let head = String::from_utf8(bytes[..end].to_vec()).expect("a head");
    let field = |name: &str| {
        let line = head.lines().find_map(|line| line.strip_prefix(name));
        line.map(|text| text.trim().to_owned())
    };
    let length: usize = field("Content-Length:")
        .expect("a length")
        .parse()
        .expect("a number");
    let mut body = bytes[end..].to_vec();
    while body.len() < length {
        let count = stream.read(&mut piece).expect("a body");
        assert!(count > 0, "half a body");
        body.extend_from_slice(&piece[..count]);
    }
    let status = head
        .split(' ')
        .nth(1)
        .expect("a status")
        .parse()
        .expect("a number");
    Answer { status, head, body }
}

#[test]
fn view_refuses_whoever_may_not_ask() {
    let viewer = Running::new(&[]);
    let (token, port) = (&viewer.token, viewer.port);
    let page = viewer.get("");
    assert_eq!(page.status, 200);
    assert!(page.text().contains("<canvas"));
    for header in [
        "Content-Security-Policy: default-src 'none'; script-src 'self'",
        "Referrer-Policy: no-referrer",
        "X-Content-Type-Options: nosniff",
    ] {
        assert!(page.head.contains(header), "{}", page.head);
    }
    // The page loads nothing from other hosts.
    let scripts = ["page", "camera", "pixel", "curve", "film", "drop"];
    let scripts = scripts.map(|name| format!("{name}.js"));
    for file in ["", "page.css"]
        .into_iter()
        .chain(scripts.iter().map(String::as_str))
    {
        let text = viewer
            .get(file)
            .text()
            .replace("http://www.w3.org/2000/svg", "");
        assert!(!text.contains("://"), "{file}");
    }
    let own = format!("Origin: http://localhost:{port}\r\n");
    assert_eq!(viewer.request("GET", "facts", &own, "").status, 200);
    for origin in [
        "http://evil.example",
        "null",
        "http://127.0.0.1:1",
        "https://127.0.0.1",
        &format!("http://127.0.0.1:{port}.evil.example"),
        &format!("https://127.0.0.1:{port}"),
        &format!("http://localhost:{port}/"),
    ] {
        let header = format!("Origin: {origin}\r\nContent-Type: application/json\r\n");
        for (method, path) in [("GET", "facts"), ("POST", "set")] {
            let answer = viewer.request(method, path, &header, "{}");
            assert_eq!(answer.status, 403, "{origin} {path}");
        }
    }
    // Host names of another site that resolve to this machine, and other forms of the address.
    for host in [
        format!("evil.example:{port}"),
        "127.0.0.1".into(),
        format!("127.0.0.1:{}", port ^ 1),
        format!("127.0.0.1:{port}.evil.example"),
        format!("evil.example@127.0.0.1:{port}"),
        format!("localhost.:{port}"),
        format!("0.0.0.0:{port}"),
        format!("[::1]:{port}"),
        format!("127.1:{port}"),
    ] {
        let text = format!("GET /{token}/ HTTP/1.1\r\nHost: {host}\r\n\r\n");
        assert_eq!(viewer.raw(text.as_bytes()).status, 403, "{host}");
    }
    assert_eq!(
        viewer
            .raw(format!("GET /{token}/ HTTP/1.1\r\n\r\n").as_bytes())
            .status,
        403
    );
    let wrong = format!("{}0", &token[..31]);
    let wrong = if wrong == *token {
        format!("{}1", &token[..31])
    } else {
        wrong
    };
    for path in [
        "/",
        "/page.js",
        "//",
        "/../",
        &format!("/{wrong}/"),
        &format!("/{}/", &token[..16]),
        &format!("/{token}"),
        &format!("//{token}/"),
        &format!("/./{token}/"),
        &format!("/x/../{token}/"),
        &format!("/?{token}/"),
        &format!("http://127.0.0.1:{port}/{token}/"),
        &format!("/%{:02x}{}/", token.as_bytes()[0], &token[1..]),
        "*",
    ] {
        let text = format!("GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n");
        assert_eq!(viewer.raw(text.as_bytes()).status, 404, "{path}");
    }
    for path in [
        "../../etc/passwd",
        "%2e%2e/box.glb",
        "/etc/passwd",
        "page.js/",
        "./page.js",
        "box.glb",
        "page.css%00",
        "..\\box.glb",
        "//page.js",
        "page.js;x",
        "%70age.js",
        "PAGE.JS",
        "page.js#",
        "../facts",
    ] {
        assert_eq!(viewer.get(path).status, 404, "{path}");
    }
    assert_eq!(viewer.get("set").status, 405);
    assert_eq!(viewer.request("DELETE", "facts", "", "").status, 405);
    assert_eq!(
        viewer
            .request("POST", "set", "Content-Type: text/plain\r\n", "{}")
            .status,
        415
    );
}

#[test]
fn view_refuses_messages_that_are_too_long_or_wrong() {
    let viewer = Running::new(&[]);
    viewer.done();
    let (before, _) = viewer.poll(0);
    let long = format!("X: {}\r\n", "x".repeat(1 << 14));
    assert_eq!(viewer.request("GET", "facts", &long, "").status, 431);
    let many = "X: y\r\n".repeat(200);
    assert_eq!(viewer.request("GET", "facts", &many, "").status, 431);
    let kind = "Content-Type: application/json\r\n";
    let body = format!("{{\"options\": {{\"env\": \"{}\"}}}}", "x".repeat(1 << 17));
    assert_eq!(viewer.request("POST", "set", kind, &body).status, 413);
    let endless = format!(
        "POST /{}/set HTTP/1.1\r\nHost: 127.0.0.1:{}\r\nContent-Length: 18446744073709551615\r\n\r\n",
        viewer.token, viewer.port
    );
    assert_eq!(viewer.raw(endless.as_bytes()).status, 413);
    assert_eq!(
        viewer
            .request(
                "POST",
                "set",
                &format!("{kind}Transfer-Encoding: chunked\r\n"),
                ""
            )
            .status,
        411
    );
    // A request hidden in another by ambiguous lengths, and two host headers.
    let (token, port) = (&viewer.token, viewer.port);
    let host = format!("Host: 127.0.0.1:{port}\r\n");
    for head in [
        format!("{host}Host: evil.example\r\n"),
        format!("{host}Content-Length: 0\r\nContent-Length: 50\r\n"),
        format!("{host}Content-Length: -1\r\n"),
        format!("{host}Content-Length: 0x10\r\n"),
    ] {
        let text = format!("POST /{token}/set HTTP/1.1\r\n{head}\r\n");
        assert_eq!(viewer.raw(text.as_bytes()).status, 400, "{head}");
    }
    assert_eq!(
        viewer
            .raw(b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03 what is this\r\n\r\n")
            .status,
        400
    );
    for (message, words) in [
        (json!({ "options": { "integrator": "magic" } }), "expected"),
        (json!({ "options": { "max_vertices": -1 } }), "whole number"),
        (json!({ "options": { "env": "/etc/hosts" } }), "no file"),
        (json!({ "options": { "table": "other.json" } }), "no file"),
        (json!({ "options": { "size": "9x9" } }), "cannot change"),
        (json!({ "options": { "levels": 3 } }), "--set levels"),
        (
            json!({ "look": { "position": [0, 0, 0], "target": [0, 0, 0], "up": [0, 1, 0], "fov": 40 } }),
            "one point",
        ),
        (json!({ "other": "reference" }), "--reference"),
        (json!({ "unknown": 1 }), "unknown"),
        (json!([1]), "not a message"),
    ] {
        let answer = viewer.post("set", &message);
        assert_eq!(answer.status, 400, "{message}");
        assert!(
            answer.text().contains(words),
            "{message}: {}",
            answer.text()
        );
    }
    for path in [
        "pixel",
        "pixel?x=24&y=0",
        "pixel?x=-1&y=0",
        "paths?x=1",
        "pixel?x=99999999999&y=1",
    ] {
        assert_eq!(viewer.get(path).status, 400, "{path}");
    }
    assert_eq!(
        viewer
            .post("pick", &json!({ "x": 5, "y": 5, "what": "all" }))
            .status,
        400
    );
    let (after, _) = viewer.poll(0);
    assert_eq!(before["state"]["options"], after["state"]["options"]);
    assert_eq!(before["state"]["run"], after["state"]["run"]);
}

/// Size and picture of a render with these options, without the viewer.
fn rendered(viewer: &Running, asked: &Spec) -> ([u32; 2], opsr::image::Buffer) {
    let opened = asked.open(&viewer.scene, opsr_formats::FORMATS, Scene::new);
    let opened = opened.expect("a scene");
    let subject = Subject {
        scene: &opened.scene,
        name: "",
        sha256: "",
        in_studio: false,
    };
    let request = Request::new(asked, subject, None).expect("a request");
    let frame = request.frame.to_array();
    let go_on = &mut |_: &_, _: &_| ControlFlow::Continue(());
    let (request, output) = run(request, go_on).expect("a render");
    (frame, request.spec.shown(&output.picture))
}

/// RGB bytes of RGBA pixels.
fn colours(pixels: &[u8]) -> Vec<u8> {
    let pixels = pixels.chunks_exact(4);
    pixels.flat_map(|p| &p[..3]).copied().collect()
}

/// With a moved camera and another method the page shows the render of the saved view: the same bits in the file, the
/// same bytes on the page.
#[test]
fn view_picture_is_that_of_a_render_with_the_saved_view() {
    for choices in [
        &[][..],
        &[("table", json!(0.3))],
        &[("integrator", json!("bdpt"))],
    ] {
        let viewer = Running::new(&[("exposure", json!(0.5))]);
        let (first, _) = viewer.done();
        let mut look = first["state"]["look"].clone();
        look["position"][0] = json!(0.37);
        let options: serde_json::Map<String, Value> = choices
            .iter()
            .map(|(name, value)| ((*name).to_owned(), value.clone()))
            .collect();
        let answer = viewer.post("set", &json!({ "look": look, "options": options }));
        assert_eq!(answer.status, 200, "{}", answer.text());
        viewer.until(|head| head["state"]["run"] != first["state"]["run"]);
        let (head, pixels) = viewer.done();
        let saved = viewer.folder.path().join("view.json");
        std::fs::write(&saved, viewer.get("look.json").body).expect("a file");
        let shown = viewer.folder.path().join("shown.exr");
        std::fs::write(&shown, viewer.get("picture.exr").body).expect("a file");
        let png = viewer.get("picture.png").body;

        let mut asked = spec(choices);
        asked.camera = Some(CameraChoice::File(saved));
        let (frame, rendered) = rendered(&viewer, &asked);
        assert_eq!(frame, [24, 16]);
        let bits = |picture: &opsr::image::Buffer| -> Vec<[u32; 3]> {
            picture
                .pixels
                .iter()
                .map(|p| p.to_array().map(f32::to_bits))
                .collect()
        };
        let layers = exr::read_layers(&shown).expect("an EXR file");
        assert_eq!(
            bits(&layers.main().expect("a picture")),
            bits(&rendered),
            "{choices:?}"
        );
        assert_eq!(head["picture"]["samples"], 8);
        let expected = opsr::image::png::encode(&rendered, 0.5).expect("a PNG file");
        assert!(png == expected, "{choices:?}");
        let on_page = colours(&pixels);
        let display = |p| opsr::image::png::display(p, 0.5.into());
        let written: Vec<u8> = rendered.pixels.iter().flat_map(|&p| display(p)).collect();
        assert!(on_page == written, "{choices:?}");
        // The command line of the page has the same view.
        let command = head["state"]["command"]
            .as_str()
            .expect("a command")
            .to_owned();
        assert!(
            command.contains("--camera 0.37,") && command.contains("--size 24x16"),
            "{command}"
        );
    }
}

/// Clients that stall in a request or a response, many messages, and two pages do not hold up the render.
#[test]
fn view_is_held_up_by_no_client() {
    let viewer = Running::new(&[("spp", json!(4096)), ("size", json!("160x120"))]);
    let mut stalled = Vec::new();
    for i in 0..12 {
        let mut stream = viewer.connect();
        let (token, port) = (&viewer.token, viewer.port);
        let whole = if i % 2 == 0 { "\r\n" } else { "" };
        let text = format!(
            "GET /{token}/poll?frame=0&words=0 HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n{whole}"
        );
        // Clients that repeat requests and never read.
        let times = if i % 2 == 0 { 400 } else { 1 };
        stream
            .set_write_timeout(Some(Duration::from_millis(50)))
            .expect("a time");
        let _ = stream.write_all(text.repeat(times).as_bytes());
        stalled.push(stream);
    }
    let (first, _) = viewer.until(|head| head["picture"]["samples"].as_u64() > Some(0));
    let clock = Instant::now();
    for i in 0..300 {
        let answer = viewer.post(
            "set",
            &json!({ "options": { "exposure": 0.01 * f64::from(i) } }),
        );
        assert_eq!(answer.status, 200);
    }
    assert!(
        clock.elapsed() < Duration::from_secs(10),
        "{:?}",
        clock.elapsed()
    );
    // The render has continued, and both pages show the same.
    let samples = |head: &Value| {
        head["state"]["course"]["samples"]
            .as_u64()
            .expect("samples")
    };
    let (later, _) = viewer.until(|head| samples(head) > samples(&first) + 2);
    assert_eq!(later["state"]["run"], first["state"]["run"]);
    viewer.post("set", &json!({ "paused": true }));
    viewer.until(|head| head["state"]["phase"] == "paused");
    let ((a, of_a), (b, of_b)) = (viewer.done_paused(), viewer.done_paused());
    assert_eq!(
        (&a["frame"], a["state"]["paused"].clone()),
        (&b["frame"], json!(true))
    );
    assert!(of_a == of_b && of_a.len() == 160 * 120 * 4);
    drop(stalled);
}

/// Clients without the token cannot keep pages out by open connections, and a slow one is disconnected.
#[test]
fn view_has_room_beside_strangers() {
    let viewer = Running::new(&[]);
    let (token, port) = (&viewer.token, viewer.port);
    let mut slow = viewer.connect();
    slow.set_nodelay(true).expect("no delay");
    let strangers: Vec<TcpStream> = (0..100)
        .map(|i| {
            let mut stream = viewer.connect();
            let _ = stream.write_all(if i % 2 == 0 { b"GET /" } else { b"" });
            stream
        })
        .collect();
    assert_eq!(viewer.get("facts").status, 200);
    // A refused client must connect again.
    let mut refused = viewer.connect();
    let text = format!("GET /{token}/ HTTP/1.1\r\nHost: evil.example:{port}\r\n\r\n");
    refused.write_all(text.as_bytes()).expect("sent");
    assert_eq!(read(&mut refused).status, 403);
    assert!(!matches!(refused.read(&mut [0]), Ok(1..)));
    drop(strangers);
    // Clients with the token take all connections; once they close there is room.
    let known: Vec<TcpStream> = (0..48)
        .map_while(|_| {
            let mut stream = viewer.connect();
            let text = format!("GET /{token}/page.css HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n");
            stream.write_all(text.as_bytes()).expect("sent");
            (read(&mut stream).status == 200).then_some(stream)
        })
        .collect();
    assert!(known.len() > 40, "{}", known.len());
    assert_eq!(viewer.get("facts").status, 503);
    drop(known);
    let end = Instant::now() + Duration::from_secs(10);
    while viewer.get("facts").status != 200 {
        assert!(Instant::now() < end, "places do not come back");
        std::thread::sleep(Duration::from_millis(20));
    }
    // Closed when its connection was needed, or after its time limit.
    let clock = Instant::now();
    while slow.write_all(b"G").is_ok() {
        assert!(clock.elapsed() < Duration::from_secs(8), "a slow head");
        std::thread::sleep(Duration::from_millis(50));
    }
}

/// A request head that arrives byte by byte is cut off after five seconds.
#[test]
fn view_does_not_wait_for_a_slow_head() {
    let viewer = Running::new(&[]);
    let mut stream = viewer.connect();
    let clock = Instant::now();
    let mut text = b"GET /".iter().chain(std::iter::repeat(&b'a'));
    while text
        .next()
        .is_some_and(|byte| stream.write_all(&[*byte]).is_ok())
    {
        assert!(clock.elapsed() < Duration::from_secs(8), "still heard");
        std::thread::sleep(Duration::from_millis(50));
    }
}

/// Waiting polls must not use up a browser's connections: the fourth gets its response at once.
#[test]
fn view_answers_many_pages() {
    let viewer = Running::new(&[("spp", json!(1))]);
    let (head, _) = viewer.done();
    let path = format!("poll?frame={}&words={}", head["frame"], head["words"]);
    std::thread::scope(|scope| {
        let polls: Vec<_> = (0..6)
            .map(|_| scope.spawn(|| viewer.get(&path).body))
            .collect();
        let crowded = polls.into_iter().map(|poll| {
            let body = poll.join().expect("an answer");
            let length = u32::from_le_bytes(body[..4].try_into().expect("a length")) as usize;
            let head: Value = serde_json::from_slice(&body[4..4 + length]).expect("JSON");
            head["crowded"] == true
        });
        assert_eq!(crowded.filter(|crowded| *crowded).count(), 3);
    });
}

impl Running {
    /// The picture of a paused render, once it shows all samples.
    fn done_paused(&self) -> (Value, Vec<u8>) {
        self.until(|head| {
            let (shown, all) = (
                &head["picture"]["samples"],
                &head["state"]["course"]["samples"],
            );
            head["state"]["phase"] == "paused" && shown == all
        })
    }
}

#[test]
fn view_shows_what_is_asked_for() {
    let viewer = Running::new(&[("table", json!(0.3)), ("spp", json!(16))]);
    let (head, picture) = viewer.done();
    assert!(
        head["state"]["error"]
            .as_f64()
            .is_some_and(|e| e > 0.0 && e < 10.0),
        "{head}"
    );
    let mut seen = vec![picture.clone()];
    for overlay in [
        "error", "noise", "bias", "level", "normal", "albedo", "depth",
    ] {
        let before = viewer.poll(0).0["frame"].as_u64();
        assert_eq!(
            viewer.post("set", &json!({ "overlay": overlay })).status,
            200
        );
        let (head, shown) = viewer
            .until(|head| head["frame"].as_u64() > before && head["state"]["overlay"] == overlay);
        assert_eq!(
            head["state"]["course"]["samples"], 16,
            "an overlay begins no render"
        );
        assert!(!seen.contains(&shown), "{overlay}");
        seen.push(shown);
    }
    viewer.post("set", &json!({ "overlay": "picture" }));
    let pixel = viewer.json("pixel?x=12&y=12");
    assert!(
        pixel["surface"]["material"].is_string() && pixel["level"].is_number(),
        "{pixel}"
    );
    let index = 4 * (12 * 24 + 12);
    assert!(picture[index + 3] == 255 && pixel["radiance"][0].as_f64() > Some(0.0));
    // Paths are sorted by brightness, and their mean is that of the pixel.
    let paths = viewer.json("paths?x=12&y=12");
    let light = |path: &Value| {
        let of = |i: usize| path["radiance"][i].as_f64().expect("a number");
        0.2126 * of(0) + 0.7152 * of(1) + 0.0722 * of(2)
    };
    let lights: Vec<f64> = paths["paths"]
        .as_array()
        .expect("paths")
        .iter()
        .map(light)
        .collect();
    assert!(
        lights.len() > 4 && lights.windows(2).all(|w| w[0] >= w[1] * 0.9999),
        "{lights:?}"
    );
    let vertex = &paths["paths"][0]["vertices"][0];
    assert!(
        vertex["alpha_reg"].as_f64() >= vertex["alpha"].as_f64(),
        "{vertex}"
    );

    // A second render beside the first, for the same time; conflicting options are omitted and reported.
    viewer.post("set", &json!({ "other": { "integrator": "bdpt" } }));
    let (head, both) = viewer.until(|head| {
        let samples = &head["state"]["other_course"]["samples"];
        head["images"].as_array().is_some_and(|i| i.len() == 2) && *samples == json!(16)
    });
    assert_eq!(both.len(), 2 * 24 * 16 * 4);
    // FLIP is reported for any displayed picture.
    let (head, _) = match head["state"]["flip"].is_number() {
        true => (head, both),
        false => viewer.until(|head| head["state"]["flip"].is_number()),
    };
    let flip = head["state"]["flip"].as_f64();
    assert!(flip > Some(0.0) && flip < Some(1.0), "{head}");
    assert_ne!(head["state"]["course"], head["state"]["other_course"]);
    viewer.post(
        "set",
        &json!({ "other": null, "options": { "integrator": "sppm" } }),
    );
    let (head, _) = viewer.until(|head| head["state"]["integrator"] == "sppm");
    assert!(
        head["state"]["notes"].to_string().contains("--opsr-table"),
        "{head}"
    );
    viewer.post("set", &json!({ "options": { "integrator": null } }));
    let (head, _) = viewer.until(|head| head["state"]["integrator"] == "path");
    assert_eq!(head["state"]["options"]["table"], 0.3);

    // A pick sets the focus distance.
    let run = head["state"]["run"].clone();
    let answer = viewer.post("pick", &json!({ "x": 12, "y": 12, "what": "focus" }));
    assert_eq!(answer.status, 200, "{}", answer.text());
    viewer.until(|h| h["state"]["run"] != run);
    let (head, _) = viewer.done();
    assert!(
        head["state"]["options"]["lens"]
            .as_str()
            .is_some_and(|lens| lens.contains(',')),
        "{head}"
    );
    let answer = viewer.post("pick", &json!({ "x": 9, "y": 12, "what": "target" }));
    assert_eq!(answer.status, 200, "{}", answer.text());
    let (turned, _) = viewer.until(|h| h["state"]["run"] != head["state"]["run"]);
    assert_ne!(
        turned["state"]["look"]["target"],
        head["state"]["look"]["target"]
    );
    assert_eq!(
        turned["state"]["look"]["position"],
        head["state"]["look"]["position"]
    );
}

/// The camera orbits at the depth of the objects, not of the floor in the centre; the page gets their boxes.
#[test]
fn view_knows_the_objects_of_a_studio() {
    let mut parts = SceneParts::default();
    let towers =
        [-2.0f32, 2.0].map(|x| (Vec3::new(x - 0.5, 0.0, -0.5), Vec3::new(x + 0.5, 3.0, 0.5)));
    for (low, high) in towers {
        let grey = materials::diffuse("grey", Rgb::splat(0.5));
        parts.add(grey, [shapes::cuboid(low, high)]);
    }
    let viewer = Running::of(&glb::to_glb(&parts).expect("a scene"), &[]);
    let (head, _) = viewer.done();
    let numbers = |value: &Value| -> Vec<f32> {
        let all = value.as_array().expect("numbers").iter();
        all.map(|x| x.as_f64().expect("a number") as f32).collect()
    };
    let target = Vec3::from_slice(&numbers(&head["state"]["look"]["target"]));
    let apart = target.distance(Vec3::new(0.0, 1.5, 0.0));
    assert!(
        apart < 1.5,
        "{target} for the middle: the floor is 4 behind"
    );
    let bounds = viewer.json("facts")["bounds"].clone();
    assert_eq!(numbers(&bounds[0]), [-2.5, 0.0, -0.5]);
    let mut found = [0; 3];
    for (x, y) in (0..24).flat_map(|x| (0..16).map(move |y| (x, y))) {
        let pixel = viewer.json(&format!("pixel?x={x}&y={y}"));
        let object = viewer.json(&format!("object?x={x}&y={y}"));
        assert_eq!(pixel["surface"]["object"], object["name"], "{x} {y}");
        let of = match &object["bounds"] {
            Value::Null => 2,
            bounds => usize::from(bounds[0][0].as_f64() > Some(0.0)),
        };
        found[of] += 1;
        match of {
            2 => {
                let floor = pixel["surface"]["material"] == "floor of the studio";
                assert!(floor || pixel["surface"].is_null(), "{pixel}");
            }
            i => {
                let ends = [0, 1].map(|k| Vec3::from_slice(&numbers(&object["bounds"][k])));
                assert_eq!(ends, [towers[i].0, towers[i].1]);
            }
        }
    }
    assert!(found.iter().all(|n| *n > 20), "{found:?}");
}

#[test]
fn view_says_what_is_wrong_with_a_scene() {
    let viewer = Running::of(b"glTF nothing", &[]);
    let (head, _) = viewer.until(|head| !head["state"]["fault"].is_null());
    assert!(
        head["state"]["fault"]
            .as_str()
            .expect("words")
            .contains("box.glb"),
        "{head}"
    );
    assert_eq!(viewer.get("").status, 200);
    assert_eq!(viewer.get("picture.png").status, 503);
    assert_eq!(viewer.get("pixel?x=1&y=1").status, 503);
}
