-- Kernels: learned light transport for a display, wavelength and distance, with numbered versions.
create table kernel (
    id             integer primary key,
    -- resource name, which gives the order of lists
    name           text    not null unique,
    display        text    not null references display (id),
    wavelength_pm  integer not null check (wavelength_pm > 0),
    distance_nm    integer not null check (distance_nm <> 0),
    active_version integer,
    latest_version integer not null default 0 check (latest_version >= 0),
    create_time_ms integer not null,
    unique (display, wavelength_pm, distance_nm),
    foreign key (id, active_version) references kernel_version (kernel, version)
) strict;

create table kernel_version (
    kernel         integer not null references kernel (id),
    version        integer not null check (version >= 1),
    model          text    not null check (model in ('paper', 'dense', 'smooth', 'display', 'varying')),
    artifact       text    not null references artifact (digest),
    size_bytes     integer not null check (size_bytes >= 0),
    metrics        text    not null check (json_valid(metrics)),
    lineage        text    not null check (json_valid(lineage)),
    create_time_ms integer not null,
    primary key (kernel, version)
) strict, without rowid;

create index kernel_version_by_artifact on kernel_version (artifact);

create trigger kernel_version_stays before update on kernel_version
begin select raise(abort, 'kernel versions are immutable'); end;

-- History of the alias `active`. A rollback names the move that it undoes, and no move is undone twice. So the moves
-- that are not undone form a stack, and the next rollback undoes the top one.
create table kernel_move (
    sequence     integer primary key autoincrement,
    kernel       integer not null references kernel (id),
    time_ms      integer not null,
    caller       text    not null,
    from_version integer,
    to_version   integer not null,
    reason       text    not null,
    -- generation of the display after the move
    generation   integer not null check (generation >= 1),
    undoes       integer unique references kernel_move (sequence),
    foreign key (kernel, from_version) references kernel_version (kernel, version),
    foreign key (kernel, to_version) references kernel_version (kernel, version)
) strict;

create index kernel_move_by_kernel on kernel_move (kernel, sequence);

create trigger kernel_move_stays before update on kernel_move
begin select raise(abort, 'the history of a kernel is append-only'); end;

create trigger kernel_move_is_kept before delete on kernel_move
begin select raise(abort, 'the history of a kernel is append-only'); end;
