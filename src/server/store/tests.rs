use serde_json::json;

use super::*;

fn setup() -> Setup {
    Setup::new(json!({ "robot": { "urdf": "<robot/>", "base": "a", "tip": "b" } }))
}

fn expired(suggestion: u64) -> Event {
    Event { at_s: Some(0.1 + suggestion as f64), happened: Happened::Expired { suggestions: vec![suggestion] } }
}

#[test]
fn what_was_kept_is_read_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let id = Uuid::new_v4();
    let events: Vec<Event> = (1..=3).map(expired).collect();
    {
        let store = Store::open(folder.path()).expect("a store");
        store.insert(id, 1.5, &setup(), Shown::default(), &[]).expect("kept");
        store.append(id, 0, &events[..2], None).expect("kept");
        store.append(id, 2, &events[2..], None).expect("kept");
    }
    let store = Store::open(folder.path()).expect("the same store");
    let stored = store.load(id).expect("read").expect("there");
    assert_eq!((stored.setup, stored.events), (setup(), events));
    assert_eq!(store.all().expect("read"), [(id, 1.5)]);
    store.delete(id).expect("deleted");
    assert!(store.load(id).expect("read").is_none() && store.all().expect("read").is_empty());
    let orphan = store.append(id, 0, &[expired(1)], None).expect_err("its session is no more");
    assert!(orphan.is_for_want_of_a_session(), "{orphan}");
}

#[test]
fn nothing_is_written_twice_under_one_number() {
    let store = Store::in_memory().expect("a store");
    let id = Uuid::new_v4();
    store.insert(id, 0.0, &setup(), Shown::default(), &[]).expect("kept");
    store.append(id, 0, &[expired(1), expired(2)], None).expect("kept");
    store.append(id, 1, &[expired(3), expired(4)], None).expect_err("the second is there");
    assert_eq!(store.load(id).expect("read").expect("there").events, [expired(1), expired(2)]);
}

/// A store that may not grow behaves as on a full disk, and goes on once it may.
#[test]
fn what_does_not_fit_leaves_no_trace() {
    let folder = tempfile::tempdir().expect("a folder");
    let store = Store::open(folder.path()).expect("a store");
    let id = Uuid::new_v4();
    store.insert(id, 0.0, &setup(), Shown::default(), &[]).expect("kept");
    let pages: u32 = store.connection().pragma_query_value(None, "page_count", |row| row.get(0)).expect("a number");
    store.connection().pragma_update(None, "max_page_count", pages).expect("set");
    let long = Event { at_s: None, happened: Happened::Expired { suggestions: (0..4000).collect() } };
    let error = store.append(id, 0, &[expired(1), long.clone()], None).expect_err("it does not fit");
    assert!(error.is_for_want_of_space(), "{error}");
    assert!(store.load(id).expect("read").expect("there").events.is_empty());
    store.connection().pragma_update(None, "max_page_count", 1_000_000).expect("set");
    store.append(id, 0, &[expired(1), long.clone()], None).expect("kept");
    assert_eq!(store.load(id).expect("read").expect("there").events, [expired(1), long]);
}

/// All that was acknowledged is in one file, and who removes or cuts what stands in the folder is noticed before anything more is.
#[cfg(unix)]
#[test]
fn what_happens_to_the_files_is_noticed() {
    use std::{fs, os::unix::fs::PermissionsExt, process::Command};
    let held = |case: &str| {
        let folder = tempfile::tempdir().expect("a folder");
        let store = Store::open(folder.path()).expect(case);
        let id = Uuid::new_v4();
        store.insert(id, 0.0, &setup(), Shown::default(), &[]).expect("kept");
        (folder, store, id)
    };
    let (folder, store, id) = held("kept");
    store.append(id, 0, &[expired(1)], None).expect("kept");
    for found in fs::read_dir(folder.path()).expect("a folder") {
        let (found, is_log) =
            (found.expect("a file"), |name: &str| name.ends_with("-wal") || name.ends_with("-journal"));
        let metadata = found.metadata().expect("of a file");
        let name = found.file_name().into_string().expect("text");
        assert!(!is_log(&name) || metadata.len() == 0, "{name}");
        assert_eq!(metadata.permissions().mode() & 0o777, 0o600, "{name}");
    }

    let (folder, store, id) = held("its lock removed");
    fs::remove_file(folder.path().join("sessions.lock")).expect("removed");
    assert!(matches!(Store::open(folder.path()), Err(StoreError::Held { .. })));
    let error = store.append(id, 0, &[expired(1)], None).expect_err("another could be let in");
    assert!(error.is_for_want_of_space() && error.to_string().contains("sessions.lock"), "{error}");

    let (folder, store, id) = held("cut off");
    let file = folder.path().join(FILE);
    let whole = fs::read(&file).expect("read");
    fs::write(&file, &whole[..whole.len() / 2]).expect("cut");
    let error = store.append(id, 0, &[expired(1)], None).expect_err("cut");
    assert!(matches!(error, StoreError::Changed { .. }), "{error}");
    fs::write(&file, whole).expect("put back");
    store.append(id, 0, &[expired(1)], None).expect("kept again");

    for file in ["sessions.lock", FILE] {
        let folder = tempfile::tempdir().expect("a folder");
        let pipe = folder.path().join(file);
        assert!(Command::new("mkfifo").arg(&pipe).status().expect("a program").success());
        let error = Store::open(folder.path()).err().expect("it is a pipe").to_string();
        assert!(error.contains("is no file"), "{error}");
    }
}

#[test]
fn a_directory_is_held_by_one_and_read_by_any() {
    let folder = tempfile::tempdir().expect("a folder");
    let store = Store::open(folder.path()).expect("a store");
    let id = Uuid::new_v4();
    store.insert(id, 0.0, &setup(), Shown::default(), &[]).expect("kept");
    let error = Store::open(folder.path()).err().expect("held");
    let told = error.to_string();
    assert!(
        matches!(error, StoreError::Held { .. }) && told.contains("--data-dir") && told.contains("--ephemeral"),
        "{told}"
    );
    let reader = Store::read(folder.path()).expect("a reader");
    assert_eq!(reader.all().expect("read"), [(id, 0.0)]);
    reader.delete(id).expect_err("it only reads");
    drop(store);
    Store::open(folder.path()).expect("free again");
}

#[test]
fn later_versions_and_foreign_files_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    drop(Store::open(folder.path()).expect("a store"));
    let file = folder.path().join(FILE);
    let later = Connection::open(&file).and_then(|file| file.pragma_update(None, "user_version", schema::KNOWN + 1));
    later.expect("set");
    let error = Store::open(folder.path()).err().expect("later");
    assert!(matches!(error, StoreError::Newer { found, known, .. } if found == known + 1), "{error}");
    std::fs::remove_file(&file).expect("removed");
    Connection::open(&file).and_then(|file| file.execute_batch("CREATE TABLE other (a)")).expect("another's");
    let error = Store::open(folder.path()).err().expect("foreign");
    assert!(matches!(error, StoreError::Foreign { .. }), "{error}");
}

/// A session with events enough for pages of its own.
fn filled(store: &Store, count: u64) -> Uuid {
    let id = Uuid::new_v4();
    store.insert(id, 0.0, &setup(), Shown::default(), &[]).expect("kept");
    let events: Vec<Event> = (1..=count).map(expired).collect();
    store.append(id, 0, &events, None).expect("kept");
    id
}

fn damaged(store: &Store, id: Uuid) -> String {
    match store.load(id).expect_err("it is damaged") {
        StoreError::Damaged { what, .. } => what,
        other => panic!("{other}"),
    }
}

#[test]
fn what_was_changed_or_lost_is_noticed_and_named() {
    let store = Store::in_memory().expect("a store");
    for (change, said) in [
        ("UPDATE event SET event = replace(event, '1.1', '1.2') WHERE number = 1", "event 1 is not as it was written"),
        ("UPDATE event SET idempotency_key = 'other' WHERE number = 2", "event 2 is not as it was written"),
        ("DELETE FROM event WHERE number = 2", "event 2 is missing"),
        ("UPDATE event SET event = '{', checksum = NULL WHERE number = 3", "event 3 cannot be read"),
        ("UPDATE session SET setup = replace(setup, 'robot', 'tobor')", "its setup is not as it was written"),
        ("UPDATE session SET damage = 'events may be missing'", "events may be missing"),
    ] {
        let id = filled(&store, 4);
        let change = if change.contains("WHERE") { format!("{change} AND") } else { format!("{change} WHERE") };
        let of = if change.contains("event SET") || change.contains("FROM event") { "session" } else { "number" };
        let one = format!("{change} {of} = (SELECT number FROM session WHERE id = '{id}')");
        assert_eq!(store.connection().execute(&one, []).expect("changed"), 1, "{one}");
        let told = damaged(&store, id);
        assert!(told.contains(said) && told.contains(&id.to_string()), "{told}");
    }
}

#[test]
fn a_store_without_checksums_is_taken_up() {
    let folder = tempfile::tempdir().expect("a folder");
    let id = {
        let store = Store::open(folder.path()).expect("a store");
        let id = filled(&store, 3);
        let old = "ALTER TABLE session DROP COLUMN checksum; ALTER TABLE session DROP COLUMN damage;
                   ALTER TABLE session DROP COLUMN summary; ALTER TABLE session DROP COLUMN counted;
                   ALTER TABLE event DROP COLUMN checksum; DROP TABLE checkpoint; PRAGMA user_version = 1;";
        store.connection().execute_batch(old).expect("as version 1 had it");
        id
    };
    let events = |store: &Store| store.load(id).expect("read").expect("there").events.len();
    assert_eq!(events(&Store::read(folder.path()).expect("a reader")), 3);
    let store = Store::open(folder.path()).expect("taken up");
    store.append(id, 3, &[expired(4)], None).expect("kept");
    assert_eq!(events(&store), 4);
}

/// Whatever of the file is overwritten: every session is what it was, or said to be damaged, or not there.
#[test]
fn a_damaged_file_is_put_aside_and_the_rest_of_it_kept() {
    const PAGE: usize = 4096;
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join(FILE);
    let ids: Vec<Uuid> = {
        let store = Store::open(folder.path()).expect("a store");
        (0..6).map(|_| filled(&store, 400)).collect()
    };
    let whole = std::fs::read(&file).expect("the file");
    let (mut kept, mut told) = (0, 0);
    for page in 0..whole.len() / PAGE {
        let broken = tempfile::tempdir().expect("a folder");
        let mut bytes = whole.clone();
        bytes[page * PAGE..(page + 1) * PAGE].fill(0xA5);
        std::fs::write(broken.path().join(FILE), &bytes).expect("written");
        let store = Store::open(broken.path()).expect("it starts");
        assert!(!store.damage().is_empty(), "page {page}");
        let aside = std::fs::read(broken.path().join(format!("{FILE}.damaged-1"))).expect("put aside");
        assert_eq!(aside, bytes, "page {page}");
        let mut damaged = 0;
        for id in &ids {
            match store.load(*id) {
                Ok(Some(stored)) => {
                    assert_eq!(stored.events.len(), 400, "page {page}: half a session is none");
                    kept += 1;
                }
                Ok(None) => {}
                Err(StoreError::Damaged { .. }) => damaged += 1,
                Err(other) => panic!("page {page}: {other}"),
            }
        }
        told += damaged;
        assert!(store.damage().len() > damaged, "page {page}: {:?}", store.damage());
    }
    assert!(kept > 100 && told > 10, "{kept} kept, {told} damaged");
}

#[test]
fn what_is_no_database_is_put_aside() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join(FILE), "something else").expect("written");
    let store = Store::open(folder.path()).expect("it starts");
    assert!(store.damage()[0].contains("damaged-1") && store.all().expect("read").is_empty(), "{:?}", store.damage());
}

#[cfg(unix)]
#[test]
fn nothing_is_written_to_a_file_that_is_gone() {
    let folder = tempfile::tempdir().expect("a folder");
    let store = Store::open(folder.path()).expect("a store");
    let id = filled(&store, 2);
    let (file, elsewhere) = (folder.path().join(FILE), folder.path().join("elsewhere"));
    std::fs::rename(&file, &elsewhere).expect("moved");
    let error = store.append(id, 2, &[expired(3)], None).expect_err("it would be lost");
    assert!(matches!(error, StoreError::Gone { .. }) && error.is_for_want_of_space(), "{error}");
    store.insert(Uuid::new_v4(), 0.0, &setup(), Shown::default(), &[]).expect_err("it would be lost");
    store.delete(id).expect_err("it would come back");
    std::fs::rename(&elsewhere, &file).expect("put back");
    store.append(id, 2, &[expired(3)], None).expect("kept");
}

#[test]
fn a_file_that_is_as_large_as_it_may_be_takes_nothing_until_a_session_goes() {
    let store = Store::in_memory().expect("a store").holding(10, 200_000);
    let id = filled(&store, 10);
    let long = |count: u64| {
        (0..count).map(|_| Event { at_s: None, happened: Happened::Expired { suggestions: (0..4000).collect() } })
    };
    let other = filled(&store, 0);
    let events: Vec<Event> = long(20).collect();
    store.append(other, 0, &events, None).expect("the last one may go beyond");
    let error = store.append(id, 10, &[expired(11)], None).expect_err("it is full");
    assert!(matches!(error, StoreError::Large(200_000)), "{error}");
    store.delete(other).expect("deleted");
    store.append(id, 10, &[expired(11)], None).expect("kept");
}
