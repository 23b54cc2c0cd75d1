//! A bucket as the second cache. The server here answers the four requests that are made, over HTTP on this machine.

use crate::workshop::{NOTHING, Workshop};
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::{Arc, Mutex};

/// What the bucket holds, and what was put there in which order.
#[derive(Default)]
struct Bucket {
    objects: BTreeMap<String, Vec<u8>>,
    puts: Vec<String>,
    /// Every request is answered with this status.
    broken: Option<&'static str>,
    asked: usize,
}

/// A store that speaks S3, path style, and looks at no signature.
struct Server {
    port: u16,
    bucket: Arc<Mutex<Bucket>>,
}

impl Server {
    fn start() -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let port = listener.local_addr().unwrap().port();
        let bucket = Arc::<Mutex<Bucket>>::default();
        let shared = Arc::clone(&bucket);
        std::thread::spawn(move || {
            for stream in listener.incoming().flatten() {
                let bucket = Arc::clone(&shared);
                // A client that hangs up ends its thread.
                std::thread::spawn(move || while answer(&stream, &bucket).is_some() {});
            }
        });
        Self { port, bucket }
    }

    fn bucket(&self) -> std::sync::MutexGuard<'_, Bucket> {
        self.bucket.lock().unwrap()
    }
}

fn answer(mut stream: &TcpStream, bucket: &Mutex<Bucket>) -> Option<()> {
    let mut reader = BufReader::new(stream);
    let mut line = String::new();
    reader.read_line(&mut line).ok().filter(|length| *length > 0)?;
    let mut words = line.split(' ');
    let (method, path) = (words.next()?.to_owned(), words.next()?.to_owned());
    let mut length = 0;
    loop {
        let mut header = String::new();
        reader.read_line(&mut header).ok()?;
        let header = header.trim().to_ascii_lowercase();
        if header.is_empty() {
            break;
        }
        if let Some(text) = header.strip_prefix("content-length:") {
            length = text.trim().parse().ok()?;
        }
    }
    let mut body = vec![0; length];
    reader.read_exact(&mut body).ok()?;
    let mut bucket = bucket.lock().unwrap();
    bucket.asked += 1;
    let (status, content) = match (bucket.broken, method.as_str()) {
        (Some(status), _) => (status, Vec::new()),
        (None, "PUT") => {
            bucket.objects.insert(path.clone(), body);
            bucket.puts.push(path);
            ("200 OK", Vec::new())
        }
        (None, _) => match bucket.objects.get(&path) {
            Some(content) => ("200 OK", content.clone()),
            None => ("404 Not Found", Vec::new()),
        },
    };
    let head = format!(
        "HTTP/1.1 {status}\r\nContent-Length: {}\r\nETag: \"1\"\r\nLast-Modified: Wed, 21 Oct 2015 07:28:00 GMT\r\n\r\n",
        content.len()
    );
    stream.write_all(head.as_bytes()).ok()?;
    if method != "HEAD" {
        stream.write_all(&content).ok()?;
    }
    Some(())
}

/// The pipeline of the workshop with the bucket behind its cache.
fn shop(server: &Server) -> Workshop {
    let mut shop = Workshop::new();
    let endpoint = format!("http://127.0.0.1:{}", server.port);
    shop.environment = [
        ("AWS_ENDPOINT", endpoint.as_str()),
        ("AWS_ALLOW_HTTP", "true"),
        ("AWS_ACCESS_KEY_ID", "somebody"),
        ("AWS_SECRET_ACCESS_KEY", "something"),
        ("AWS_REGION", "anywhere"),
        ("NO_PROXY", "127.0.0.1"),
        ("TOPIPE_REMOTE", "s3://shared/team/a"),
    ]
    .map(|(name, value)| (name.to_owned(), value.to_owned()))
    .to_vec();
    shop
}

#[test]
fn what_one_machine_computes_another_finds_in_the_bucket() {
    let server = Server::start();
    let one = shop(&server);
    one.events(&[]);
    let puts = server.bucket().puts.clone();
    assert_eq!(puts.len(), 6, "{puts:#?}");
    for pair in puts.chunks(2) {
        // Content first, record last.
        assert!(pair[0].starts_with("/shared/team/a/artifacts-v1/"), "{puts:#?}");
        assert!(pair[1].starts_with("/shared/team/a/keys-v1/"), "{puts:#?}");
    }
    let another = shop(&server);
    assert_eq!(another.events(&[])[1..4], NOTHING[1..4]);
    assert_eq!(another.read("topipe-out/box/report.json"), one.read("topipe-out/box/report.json"));
    assert_eq!(server.bucket().puts.len(), 6);

    // Who only reads gives nothing.
    let reader = shop(&server);
    reader.edit("method = \"taubin\"", "method = \"taubin\"\nlambda = 0.5");
    let events = reader.events(&["--remote-read-only"]);
    assert_eq!(events[1..3], ["stage-cached mesh", "stage-started smooth"]);
    assert_eq!(server.bucket().puts.len(), 6);
}

#[test]
fn what_does_not_verify_is_not_taken_from_the_bucket() {
    let server = Server::start();
    shop(&server).events(&[]);
    for content in server.bucket().objects.values_mut() {
        let middle = content.len() / 2;
        content[middle] ^= 1;
    }
    let another = shop(&server);
    let ended = another.topipe(&["run", "box.toml", "--json"]);
    assert_eq!(ended.code, 0, "{}", ended.stderr);
    assert!(ended.stderr.contains("the remote cache s3://shared/team/a holds damage"), "{}", ended.stderr);
    assert!(!ended.stdout.contains("stage-cached"), "{}", ended.stdout);
    assert_eq!(another.topipe(&["cache", "verify"]).code, 0);
}

#[test]
fn a_bucket_that_refuses_or_is_away_costs_one_warning() {
    let server = Server::start();
    server.bucket().broken = Some("403 Forbidden");
    let refused = shop(&server);
    let ended = refused.topipe(&["run", "box.toml"]);
    assert_eq!(ended.code, 0, "{}", ended.stderr);
    let warning = "going on without the remote cache s3://shared/team/a";
    assert_eq!(ended.stderr.matches(warning).count(), 1, "{}", ended.stderr);
    assert_eq!(server.bucket().asked, 1);

    // Nobody listens there.
    let mut away = shop(&server);
    let free = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    away.environment[0].1 = format!("http://127.0.0.1:{free}");
    let ended = away.topipe(&["run", "box.toml"]);
    assert_eq!(ended.code, 0, "{}", ended.stderr);
    assert_eq!(ended.stderr.matches(warning).count(), 1, "{}", ended.stderr);
}
