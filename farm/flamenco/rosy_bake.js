// SPDX-License-Identifier: GPL-3.0-or-later
//
// A job type for Flamenco, Blender's render farm manager: RoSy's pictures of a frame range, in chunks.
// Put this file into the folder `scripts` beside the manager and restart it. Workers need Blender with
// the RoSy extension, and the .blend file and the folder under the same paths.

const JOB_TYPE = {
    label: "RoSy Bake",
    description: "Draw the RoSy fields of a scene at every frame, as image sequences",
    settings: [
        {
            key: "frames",
            type: "string",
            required: true,
            eval: "f'{C.scene.frame_start}-{C.scene.frame_end}'",
            evalInfo: { showLinkButton: true, description: "Scene frame range" },
            description: "Frames to draw, such as '47', '1-30', or '3, 5-10, 47-327'",
        },
        {
            key: "chunk_size",
            type: "int32",
            default: 10,
            description: "Number of frames in each task",
            visible: "submission",
        },
        {
            key: "cameras",
            type: "string",
            default: "",
            description: "Names of cameras, separated by commas, for one sequence each. Empty: the camera "
                + "that renders each frame",
        },
        {
            key: "folder",
            type: "string",
            subtype: "dir_path",
            required: true,
            eval: "bpy.path.abspath(C.scene.rosy.directory)",
            description: "Folder of the pictures. All workers must be able to write to it",
        },
        {
            key: "preset",
            type: "string",
            default: "",
            description: "Name of a preset. Empty: the look of the scene",
        },
        {
            key: "blendfile",
            type: "string",
            required: true,
            eval: "bpy.data.filepath",
            description: "Path of the .blend file",
            visible: "web",
        },
    ],
};

function compileJob(job) {
    const settings = job.settings;
    for (const camera of cameraNames(settings.cameras)) {
        for (const chunk of frameChunker(settings.frames, settings.chunk_size)) {
            job.addTask(bakeTask(settings, camera, chunk));
        }
    }
}

// Return a task that runs the command `bake` for some frames. Frames that exist and are up to date are
// kept, so a task can run again, or twice at once. The folder is a word of its own, because the manager
// translates only paths at the start of a word. Names are not, because they may begin with a dash.
function bakeTask(settings, camera, chunk) {
    const args = ["--out", settings.folder, `--frames=${chunk}`];
    if (camera) {
        args.push(`--camera=${camera}`);
    }
    if (settings.preset) {
        args.push(`--preset=${settings.preset}`);
    }
    const task = author.Task(camera ? `${camera} ${chunk}` : `frames ${chunk}`, "blender");
    task.addCommand(author.Command("exec", {
        exe: "{blender}",
        args: ["-b", settings.blendfile, "--command", "rosy", "bake"].concat(args),
    }));
    return task;
}

// Return the names of the cameras, or one empty name for the camera that renders each frame.
function cameraNames(text) {
    const names = (text || "").split(",").map((name) => name.trim()).filter((name) => name);
    return names.length ? names : [""];
}
