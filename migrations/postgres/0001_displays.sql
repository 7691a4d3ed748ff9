-- Functions of SQLite that statements and checks use and PostgreSQL does not have.
create function max(bigint, bigint) returns bigint language sql immutable strict return greatest($1, $2);

create function instr(text, text) returns integer language sql immutable strict return position($2 in $1);

create function json_valid(text) returns boolean language sql immutable strict return $1::json is not null;

create function json_array_length(text) returns integer language sql immutable strict return json_array_length($1::json);

create function json_each(text) returns table (value text) language sql immutable strict as $$
    select json_array_elements_text($1::json)
$$;

create function json_each(text, path text) returns table (value text) language sql immutable strict as $$
    select json_array_elements_text($1::json -> substr(path, 3))
$$;

-- Refuses a change of a row that stays as it is.
create function refuse() returns trigger language plpgsql as $$
begin raise exception '%', tg_argv[0]; end $$;

-- Which programs can work on these tables. A program that does not know all migrations works on them if each of the others
-- has a row here, and the program knows `known_min` migrations at least.
create table older_programs (
    migration bigint not null primary key,
    known_min bigint not null check (known_min between 1 and migration - 1)
);

-- Displays. Holograms are made for them, and kernels are learned from them.
create table display (
    id                 text collate "C" not null primary key check (length(id) between 1 and 63),
    -- all properties as JSON; equal displays have equal text
    content            text collate "C" not null check (json_valid(content)),
    create_time_ms     bigint           not null,
    -- grows with every change of the properties; a change of an older revision is refused
    revision           bigint           not null default 1 check (revision >= 1),
    -- number of changes so far of what devices get (moves of `active`, rollbacks and rollouts of the display's kernels),
    -- and the time of the last one
    generation         bigint           not null default 0 check (generation >= 0),
    generation_time_ms bigint           not null default 0
);

create trigger generation_rises before update on display for each row
when (new.generation < old.generation)
execute function refuse('the generation of a display never falls');
