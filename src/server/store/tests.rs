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
    let later = Connection::open(&file).and_then(|file| file.pragma_update(None, "user_version", 2));
    later.expect("set");
    let error = Store::open(folder.path()).err().expect("later");
    assert!(matches!(error, StoreError::Newer { found: 2, known: 1, .. }), "{error}");
    std::fs::remove_file(&file).expect("removed");
    Connection::open(&file).and_then(|file| file.execute_batch("CREATE TABLE other (a)")).expect("another's");
    let error = Store::open(folder.path()).err().expect("foreign");
    assert!(matches!(error, StoreError::Foreign { .. }), "{error}");
}
