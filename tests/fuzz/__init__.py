"""Random hostile input for the command line: files, options, streams and signals.

A case is made from a category and a seed, so it can be repeated. Each case runs in a process of its
own with limits of time and memory, and is judged by what it prints, its exit status and the files
that it leaves. `python -m tests.fuzz --help` lists the options; `make fuzz` runs all categories.

Modules in order of dependence:

    damage      faults of the bytes and words of a file
    options     options of a command, from its parser, and values of settings
    meshes      polygon meshes with faults of geometry and topology, and their files
    files       files of fields, guides, pictures and presets
    singular    files of singularities, and what became of them
    uv_maps     UV maps with tiles, and the files of tiles
    signals     commands that start other processes, and their files
    links       links at the paths of outputs
    names       titles, labels and names of files
    simulations files of simulations, with references to other files
    cases       the categories: files, a command line, and what it may write
    execution   the processes
    verdicts    what is wrong with a run
    runner      many cases, and a table of the outcomes
"""
