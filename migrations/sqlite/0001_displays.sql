-- Which programs can work on these tables. A program that does not know all migrations works on them if each of the others
-- has a row here, and the program knows `known_min` migrations at least.
create table older_programs (
    migration integer not null primary key,
    known_min integer not null check (known_min between 1 and migration - 1)
) strict;

-- Displays. Holograms are made for them, and kernels are learned from them.
create table display (
    id             text    not null primary key check (length(id) between 1 and 63),
    -- all properties as JSON; equal displays have equal text
    content        text    not null check (json_valid(content)),
    create_time_ms integer not null,
    -- grows with every change of the properties; a change of an older revision is refused
    revision       integer not null default 1 check (revision >= 1),
    -- number of changes so far of what devices get (moves of `active`, rollbacks and rollouts of the display's kernels),
    -- and the time of the last one
    generation         integer not null default 0 check (generation >= 0),
    generation_time_ms integer not null default 0
) strict, without rowid;

create trigger generation_rises before update on display
when new.generation < old.generation
begin select raise(abort, 'the generation of a display never falls'); end;
