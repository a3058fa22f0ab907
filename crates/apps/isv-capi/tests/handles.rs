//! Handles and threads: wrong handles are told apart, and each serves one call at a time.

mod support;

use isv_capi::*;
use std::ffi::{CStr, c_void};
use std::ptr::{null, null_mut};
use support::{
    Cuboid, append, fails, mesh_of, mesh_of_next, message, next, ok, open, options, sized, stream,
};

#[test]
fn handles_that_are_none_are_told_apart() {
    let bytes = stream(1);
    let reader = open(&bytes);
    let mut frame = null_mut();
    let local = 0_u64;
    // SAFETY: places are good. Handles are numbers, which are never followed.
    unsafe {
        let refuse = |reader: *mut isv_reader, words: &str| {
            let mut frame = null_mut();
            fails(isv_reader_next_frame(reader, &mut frame), ISV_ERROR_HANDLE, words);
            fails(isv_reader_seek(reader, 0), ISV_ERROR_HANDLE, words);
            fails(isv_reader_set_lod(reader, 1), ISV_ERROR_HANDLE, words);
            fails(isv_reader_info(reader, &mut sized!(isv_stream_info)), ISV_ERROR_HANDLE, words);
        };
        refuse(null_mut(), "isv_reader is null");
        refuse((&raw const local).cast_mut().cast(), "did not come from this library");
        refuse(77 as *mut isv_reader, "did not come from this library");
        refuse(usize::MAX as *mut isv_reader, "did not come from this library");
        let options = options();
        refuse(options.cast(), "isv_encode_options was given in place of an isv_reader");
        fails(isv_reader_free(options.cast()), ISV_ERROR_HANDLE, "in place of");
        ok(isv_encode_options_free(options));
        fails(isv_encode_options_free(options), ISV_ERROR_HANDLE, "freed before");
        ok(isv_reader_next_frame(reader, &mut frame));
        ok(isv_reader_free(reader));
        refuse(reader, "freed before");
        fails(isv_reader_free(reader), ISV_ERROR_HANDLE, "freed before");
        fails(isv_reader_next_frame(reader, null_mut()), ISV_ERROR_ARGUMENT, "frame is null");
        ok(isv_frame_free(frame));
        fails(isv_frame_get_mesh(frame, &mut sized!(isv_mesh)), ISV_ERROR_HANDLE, "freed before");
        fails(isv_frame_get_info(null(), &mut sized!(isv_frame_info)), ISV_ERROR_HANDLE, "isv_frame is null");
        fails(isv_writer_push_mesh(null_mut(), null()), ISV_ERROR_HANDLE, "isv_writer is null");
        fails(isv_writer_finish(null_mut(), null_mut()), ISV_ERROR_HANDLE, "isv_writer is null");
        let mut writer = null_mut();
        fails(
            isv_writer_create_callback(Some(append), null_mut(), frame.cast(), &mut writer),
            ISV_ERROR_HANDLE,
            "isv_encode_options was freed before",
        );
        fails(
            isv_writer_create_callback(None, null_mut(), null(), &mut writer),
            ISV_ERROR_ARGUMENT,
            "callback is null",
        );
    }
    // Null may be freed: it is what a failed call leaves.
    ok(isv_reader_free(null_mut()));
    ok(isv_writer_free(null_mut()));
    ok(isv_frame_free(null_mut()));
    ok(isv_encode_options_free(null_mut()));
    ok(isv_decode_options_free(null_mut()));
    ok(isv_text_free(null()));
    fails(isv_text_free(c"mine".as_ptr()), ISV_ERROR_HANDLE, "no text of this library");
}

/// User data of a write callback: a writer that it calls, and the status of that call.
struct Loop {
    writer: *mut isv_writer,
    found: isv_status,
}

#[test]
fn a_handle_serves_one_call_at_a_time() {
    unsafe extern "C" fn call_again(user: *mut c_void, _: *const u8, _: usize) -> i32 {
        // SAFETY: the test gives a loop, and the mesh is good.
        unsafe {
            let around = &mut *user.cast::<Loop>();
            around.found = isv_writer_push_mesh(around.writer, &Cuboid::new(0.0).mesh());
        }
        0
    }
    let mut around = Loop { writer: null_mut(), found: ISV_OK };
    let user = (&raw mut around).cast();
    // SAFETY: the loop outlives the writer, and meshes are good.
    unsafe {
        ok(isv_writer_create_callback(Some(call_again), user, null(), &raw mut around.writer));
        ok(isv_writer_push_mesh(around.writer, &Cuboid::new(0.0).mesh()));
        ok(isv_writer_finish(around.writer, null_mut()));
    }
    fails(around.found, ISV_ERROR_BUSY, "one call at a time");
    ok(isv_writer_free(around.writer));
}

#[test]
fn a_writer_may_be_freed_by_its_own_callback() {
    unsafe extern "C" fn free(user: *mut c_void, _: *const u8, _: usize) -> i32 {
        // SAFETY: the test gives a loop.
        let around = unsafe { &mut *user.cast::<Loop>() };
        around.found = isv_writer_free(around.writer);
        0
    }
    let mut around = Loop { writer: null_mut(), found: ISV_END };
    let user = (&raw mut around).cast();
    // SAFETY: the loop outlives the writer, and the mesh is good.
    unsafe {
        ok(isv_writer_create_callback(Some(free), user, null(), &raw mut around.writer));
        ok(isv_writer_push_mesh(around.writer, &Cuboid::new(0.0).mesh()));
        fails(isv_writer_finish(around.writer, null_mut()), ISV_ERROR_HANDLE, "freed before");
    }
}

#[test]
fn threads_share_frames_and_have_handles_of_their_own() {
    let bytes = stream(4);
    let shared = open(&bytes);
    let frame = next(shared) as usize;
    std::thread::scope(|scope| {
        let threads: Vec<_> = (0..4)
            .map(|_| {
                scope.spawn(|| {
                    let reader = open(&bytes);
                    let all: Vec<_> = (0..4).map(|_| mesh_of_next(reader)).collect();
                    ok(isv_reader_free(reader));
                    let mesh = mesh_of(frame as *const isv_frame);
                    (all, mesh.positions as usize)
                })
            })
            .collect();
        let found: Vec<_> = threads.into_iter().map(|thread| thread.join().unwrap()).collect();
        assert!(found.iter().all(|one| *one == found[0]), "all threads see the same");
    });
    ok(isv_frame_free(frame as *mut isv_frame));
    ok(isv_reader_free(shared));
}

#[test]
fn a_reader_may_be_freed_while_another_thread_decodes() {
    let reader = open(&stream(8)) as usize;
    let decoder = std::thread::spawn(move || {
        loop {
            let mut frame = null_mut();
            // SAFETY: the place is good, and a handle is a number.
            match unsafe { isv_reader_next_frame(reader as *mut isv_reader, &mut frame) } {
                ISV_OK => ok(isv_frame_free(frame)),
                ISV_END => ok(isv_reader_seek(reader as *mut isv_reader, 0)),
                status => break (status, message()),
            }
        }
    });
    std::thread::sleep(std::time::Duration::from_millis(100));
    ok(isv_reader_free(reader as *mut isv_reader));
    let (status, message) = decoder.join().unwrap();
    assert_eq!((status, &*message), (ISV_ERROR_HANDLE, "the isv_reader was freed before"));
}

#[test]
fn results_have_names() {
    let name = |status| {
        // SAFETY: the text is never freed.
        unsafe { CStr::from_ptr(isv_status_name(status)) }.to_str().unwrap().to_owned()
    };
    let names: std::collections::BTreeSet<_> = (ISV_ERROR_INTERNAL..=ISV_END).map(name).collect();
    assert_eq!(names.len(), 15);
    assert_eq!((&*name(ISV_ERROR_FRAME), &*name(-99)), ("ISV_ERROR_FRAME", "unknown"));
}

#[test]
fn threads_start_once() {
    fails(isv_set_thread_count(0), ISV_ERROR_ARGUMENT, "0 threads");
    fails(isv_set_thread_count(u32::MAX), ISV_ERROR_ARGUMENT, "threads");
    stream(1);
    fails(isv_set_thread_count(2), ISV_ERROR_STATE, "threads");
}
