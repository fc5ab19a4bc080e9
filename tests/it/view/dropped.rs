//! Files dropped onto the page: access, refusals, and removal of their copies.

use super::{Answer, Running, read};
use crate::support::gltf::File;
use opsr_lab::gallery::{self, glb};
use serde_json::{Value, json};
use std::io::Write;
use std::path::Path;
use std::time::{Duration, Instant};

const KIND: &str = "Content-Type: application/octet-stream\r\n";

/// The body of a request with files.
fn message(files: &[(&str, &[u8])]) -> Vec<u8> {
    let list = files.iter();
    let list = list.map(|(name, bytes)| json!({ "name": name, "size": bytes.len() }));
    let list = Value::from_iter(list).to_string();
    let mut all = (list.len() as u32).to_le_bytes().to_vec();
    all.extend(list.bytes());
    all.extend(files.iter().flat_map(|(_, bytes)| *bytes));
    all
}

impl Running {
    fn head_of_open(&self, headers: &str, length: usize) -> String {
        let (token, port) = (&self.token, self.port);
        format!(
            "POST /{token}/open HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nContent-Length: {length}\r\n{headers}\r\n"
        )
    }

    fn open(&self, files: &[(&str, &[u8])]) -> Answer {
        let body = message(files);
        let head = self.head_of_open(KIND, body.len());
        self.raw(&[head.as_bytes(), &body].concat())
    }
}

fn scene() -> Vec<u8> {
    glb::to_glb(&gallery::caustic_box()).expect("a scene")
}

/// A scene whose buffer has this URI, and the buffer.
fn naming(uri: &str) -> (Vec<u8>, Vec<u8>) {
    let mut file = File::from_glb(&scene());
    file.json["buffers"] = json!([{ "byteLength": file.bytes.len(), "uri": uri }]);
    (file.json.to_string().into_bytes(), file.bytes)
}

/// A dropped scene replaces the last one, under a name without a path; its folder is deleted with it or the viewer.
#[test]
fn view_opens_dropped_files() {
    let viewer = Running::new(&[]);
    let (before, first) = viewer.done();
    let turned = json!({ "look": { "position": [0.3, 1.0, 3.0], "target": [0, 1, 0], "up": [0, 1, 0], "fov": 40 } });
    viewer.post("set", &turned);
    let mut places = Vec::new();
    let (gltf, bytes) = naming("parts/a%20buffer.bin");
    let folder: [(&str, &[u8]); 2] = [
        ("chair/chair.gltf", &gltf),
        ("chair/parts/a buffer.bin", &bytes),
    ];
    let glb = scene();
    for (files, name) in [
        (&folder[..], "chair/chair.gltf"),
        (&[("it's.glb", &glb[..])], "it's.glb"),
    ] {
        let (head, _) = viewer.poll(0);
        let answer = viewer.open(files);
        assert_eq!(answer.status, 200, "{}", answer.text());
        viewer.until(|now| now["state"]["run"] != head["state"]["run"]);
        let (head, pixels) = viewer.done();
        // The same scene from the file's camera.
        assert!(pixels == first, "{name}");
        assert_ne!(head["state"]["scene"], before["state"]["scene"]);
        let facts = viewer.json("facts");
        assert_eq!(facts["scene"], head["state"]["scene"]);
        let stem = name
            .rsplit('/')
            .next()
            .and_then(|name| name.split('.').next());
        assert_eq!(facts["title"].as_str(), stem);
        let command = head["state"]["command"].as_str().expect("a command");
        let word = name.replace('\'', r"'\''");
        assert!(
            command.contains(&word) && !command.contains("opsr-"),
            "{command}"
        );
        assert!(
            head["state"]["notes"].to_string().contains("own path"),
            "{head}"
        );
        places.push(head["state"]["scene"].as_str().expect("a path").to_owned());
    }
    let gone = |place: &str| {
        let end = Instant::now() + Duration::from_secs(10);
        while Path::new(place).exists() {
            assert!(Instant::now() < end, "{place} is there");
            std::thread::sleep(Duration::from_millis(20));
        }
    };
    gone(&places[0]);
    assert!(Path::new(&places[1]).exists());
    let own = viewer.scene.clone();
    drop(viewer);
    gone(&places[1]);
    let all = Path::new(&places[1]).parent().and_then(Path::parent);
    assert!(!own.exists() && all.is_some_and(|all| !all.exists()));
}

/// Files of clients without access are refused unread; others if they are too long, invalid, or refer to other folders.
/// The displayed scene stays.
#[test]
fn view_refuses_dropped_files() {
    let viewer = Running::new(&[]);
    let (before, _) = viewer.done();
    let (token, port) = (viewer.token.clone(), viewer.port);
    let own = format!("Host: 127.0.0.1:{port}\r\n");
    let long = format!("{KIND}Content-Length: 200000000\r\n");
    let other = format!("{}{}", &token[1..], &token[..1]);
    for (path, headers, status) in [
        (format!("/{other}/open"), own.clone(), 404),
        ("/open".into(), own.clone(), 404),
        (
            format!("/{token}/open"),
            format!("Host: evil.example:{port}\r\n"),
            403,
        ),
        (
            format!("/{token}/open"),
            format!("{own}Origin: http://evil.example\r\n"),
            403,
        ),
        (
            format!("/{token}/open"),
            format!("{own}Origin: null\r\n"),
            403,
        ),
    ] {
        let text = format!("POST {path} HTTP/1.1\r\n{headers}{long}\r\n");
        let clock = Instant::now();
        assert_eq!(
            viewer.raw(text.as_bytes()).status,
            status,
            "{path} {headers}"
        );
        assert!(
            clock.elapsed() < Duration::from_secs(3),
            "the body was waited for"
        );
    }
    let too_long = viewer.head_of_open(KIND, (1 << 28) + 1);
    assert_eq!(viewer.raw(too_long.as_bytes()).status, 413);
    assert_eq!(viewer.get("open").status, 405);
    for kind in ["application/json", "text/plain", "multipart/form-data"] {
        let kind = format!("Content-Type: {kind}\r\n");
        let body = message(&[("a.glb", &scene())]);
        let head = viewer.head_of_open(&kind, body.len());
        assert_eq!(viewer.raw(&[head.as_bytes(), &body].concat()).status, 415);
    }
    let secret = viewer.folder.path().join("secret.bin");
    let (_, bytes) = naming("");
    std::fs::write(&secret, bytes).expect("a file");
    let secret = secret.display().to_string();
    let up = format!("{}{secret}", "../".repeat(20));
    for (uri, words) in [
        ("square.bin", "dropped along"),
        (&*secret, "leaves"),
        (&*up, "leaves"),
        (&*format!("file://{secret}"), "only relative"),
    ] {
        let answer = viewer.open(&[("a.gltf", &naming(uri).0)]);
        assert_eq!(answer.status, 400, "{uri}");
        let text = answer.text();
        assert!(text.contains(words) && text.contains("a.gltf"), "{text}");
        assert!(!text.contains("opsr-"), "{text}");
    }
    for (files, words) in [
        (&[("a.glb", &b"glTF nothing"[..])][..], "a.glb"),
        (&[("../a.glb", b"")], "leads out"),
        (&[("a.pbrt", b"")], "one scene"),
        (&[], "one scene"),
    ] {
        let answer = viewer.open(files);
        assert!(
            answer.status == 400 && answer.text().contains(words),
            "{}",
            answer.text()
        );
    }
    let (after, _) = viewer.poll(0);
    for key in ["run", "options", "scene", "command"] {
        assert_eq!(before["state"][key], after["state"][key]);
    }
}

/// One upload at a time bounds the memory; a closed connection frees the place.
#[test]
fn view_takes_the_files_of_one_page_at_a_time() {
    let viewer = Running::new(&[]);
    viewer.done();
    let mut slow = viewer.connect();
    let head = viewer.head_of_open(KIND, 100);
    slow.write_all(head.as_bytes()).expect("a head");
    let end = Instant::now() + Duration::from_secs(5);
    while viewer.open(&[]).status != 503 {
        assert!(Instant::now() < end, "both are taken");
        std::thread::sleep(Duration::from_millis(20));
    }
    assert_eq!(viewer.get("facts").status, 200);
    drop(slow);
    let end = Instant::now() + Duration::from_secs(5);
    while viewer.open(&[]).status != 400 {
        assert!(Instant::now() < end, "the place is not free");
        std::thread::sleep(Duration::from_millis(20));
    }
    let mut whole = viewer.connect();
    let body = message(&[("a.glb", &scene())]);
    let head = viewer.head_of_open(KIND, body.len());
    for piece in [head.as_bytes(), &body].concat().chunks(5000) {
        whole.write_all(piece).expect("a piece");
    }
    assert_eq!(read(&mut whole).status, 200);
}
